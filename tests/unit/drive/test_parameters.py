"""Parameter files are complete, and values out of range are rejected with the field's name."""

from __future__ import annotations

from typing import Any

import pytest

from robot_stack.core.config import ConfigError, config_dir, read_yaml, validate
from robot_stack.drive.hardware_params import SwerveHardwareParams
from robot_stack.drive.params import SwerveControllerParams, module_limits
from tests.unit.drive.robot import PARAMS, ROBOT

FILES = {"swerve_controller": SwerveControllerParams, "swerve_hardware_interface": SwerveHardwareParams}


@pytest.mark.parametrize(
    ("name", "path", "value", "says"),
    [
        ("swerve_controller", "module.steering_share", 1.5, ""),
        ("swerve_controller", "module.slip_tolerance_mps", 0.0, ""),
        ("swerve_controller", "module.reversal_hysteresis_rad", 2.0, ""),
        ("swerve_controller", "drive.align_tolerance_rad", float("nan"), ""),
        ("swerve_controller", "drive.longest_step_s", float("inf"), ""),
        ("swerve_controller", "odometry.slip_factor", 0.5, ""),
        ("swerve_controller", "odometry.calibration.radius_deviation", 0.5, ""),
        ("swerve_hardware_interface", "steering_periods", 0.5, ""),
        ("swerve_hardware_interface", "session.attempts", 0, ""),
        ("swerve_hardware_interface", "command_lifetime_s", 0.6, ""),
        ("swerve_hardware_interface", "session.probe_period_s", 0.0, ""),
        ("swerve_hardware_interface", "session.retry_s", -1.0, ""),
        # A command must outlive the time after which the node answers silence.
        ("swerve_hardware_interface", "command_lifetime_s", 0.15, r"command_lifetime_s must be above 0\.15"),
    ],
)
def test_refused_values(name: str, path: str, value: Any, says: str):
    data = read_yaml(config_dir() / f"{name}.yaml")
    *branch, leaf = path.split(".")
    target = data
    for part in branch:
        target = target[part]
    target[leaf] = value
    with pytest.raises(ConfigError, match=says or f"test: {path}: "):
        validate(FILES[name], data, "test")


def test_module_limits_are_derived_from_robot_parameters():
    limits = module_limits(PARAMS.module, ROBOT)
    # 30 rad/s on 0.0825 m, 95 % of it; 80 % of the steering.
    assert limits.max_wheel_speed_mps == pytest.approx(0.95 * 30.0 * 0.0825)
    assert limits.max_steering_rate_radps == pytest.approx(0.8 * 8.0)
