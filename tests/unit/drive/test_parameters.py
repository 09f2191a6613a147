"""Parameter files are complete, and values out of range are rejected with the field's name."""

from __future__ import annotations

from typing import Any

import pytest

from robot_stack.core.config import ConfigError, config_dir, read_yaml, validate
from robot_stack.drive.hardware_params import SwerveHardwareParams
from robot_stack.drive.params import SwerveControllerParams, module_limits
from tests.unit.drive.robot import PARAMS, ROBOT


def changed(name: str, path: str, value: Any) -> dict[str, Any]:
    data = read_yaml(config_dir() / f"{name}.yaml")
    *branch, leaf = path.split(".")
    target = data
    for part in branch:
        target = target[part]
    target[leaf] = value
    return data


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("module.steering_share", 1.5),
        ("module.slip_tolerance_mps", 0.0),
        ("module.reversal_hysteresis_rad", 2.0),
        ("drive.align_tolerance_rad", float("nan")),
        ("drive.longest_step_s", float("inf")),
        ("odometry.slip_factor", 0.5),
        ("odometry.calibration.radius_deviation", 0.5),
        ("standing.speed_mps", "fast"),
    ],
)
def test_controller_refuses(path: str, value: Any):
    with pytest.raises(ConfigError, match=f"test: {path}: "):
        validate(SwerveControllerParams, changed("swerve_controller", path, value), "test")


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("steering_periods", 0.5),
        ("session.attempts", 0),
        ("command_lifetime_s", 0.6),
        ("session.probe_period_s", 0.0),
        ("session.retry_s", -1.0),
    ],
)
def test_hardware_interface_refuses(path: str, value: Any):
    with pytest.raises(ConfigError, match=f"test: {path}: "):
        validate(SwerveHardwareParams, changed("swerve_hardware_interface", path, value), "test")


def test_life_of_a_command_that_ends_before_the_node_answers_silence_is_refused():
    with pytest.raises(ConfigError, match=r"command_lifetime_s must be above 0\.15"):
        validate(SwerveHardwareParams, changed("swerve_hardware_interface", "command_lifetime_s", 0.15), "test")


def test_missing_parameter_is_named():
    data = read_yaml(config_dir() / "swerve_controller.yaml")
    del data["module"]["slip_tolerance_mps"]
    with pytest.raises(ConfigError, match=r"module\.slip_tolerance_mps: is missing"):
        validate(SwerveControllerParams, data, "test")


def test_module_limits_are_derived_from_robot_parameters():
    limits = module_limits(PARAMS.module, ROBOT)
    # 30 rad/s on 0.0825 m, 95 % of it; 80 % of the steering.
    assert limits.max_wheel_speed_mps == pytest.approx(0.95 * 30.0 * 0.0825)
    assert limits.max_steering_rate_radps == pytest.approx(0.8 * 8.0)
