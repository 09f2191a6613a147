"""Parameters: the shipped file is the documented one, and errors in a file are named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from robot_stack.core.config import ConfigError, config_dir, load, read_yaml, validate
from robot_stack.wmx.config import EngineConfig
from robot_stack.wmx.differential.params import (
    DiffDriveParams,
    motion_limits,
    named,
    parameter_file,
    twist_covariance,
)

DOCUMENTED = {
    "left_axis": 0,
    "right_axis": 1,
    "rate": 100,
    "acc_time": 1.0,
    "dec_time": 1.0,
    "wheel_radius": 0.09,
    "wheel_to_wheel": 0.55,
    "cmd_vel_topic": "/cmd_vel",
    "encoder_vel_topic": "/cmd_vel_check",
    "encoder_omega_topic": "/velocity_controller/commands",
    "encoder_odometry_topic": "/odom_enc",
}


NO_LIMITS = {
    "linear_acceleration_mps2": 0.0,
    "angular_acceleration_radps2": 0.0,
    "linear_jerk_mps3": 0.0,
    "angular_jerk_radps3": 0.0,
}


def params(**changes: Any) -> DiffDriveParams:
    return load(DiffDriveParams, "diff_drive_controller", changes)


def test_shipped_file_has_the_documented_values() -> None:
    data = read_yaml(config_dir() / "diff_drive_controller.yaml")
    assert {name: data[name] for name in DOCUMENTED} == DOCUMENTED
    assert "wmx_param_file_path" in data
    assert data["cmd_vel_timeout_s"] == 0.25
    assert data["publish_pose"] is data["publish_tf"] is False


def test_engine_of_the_base_has_two_velocity_axes() -> None:
    path = config_dir() / "wmx_engine_diff_drive.yaml"
    config = validate(EngineConfig, read_yaml(path), str(path))
    assert [config.axis_kind(axis).mode for axis in range(config.n_axes)] == ["velocity", "velocity"]


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"right_axis": 0}, "left_axis and right_axis must differ, both are 0"),
        ({"rate": float("nan")}, "rate"),
        ({"publish_tf": True}, "publish_tf needs publish_pose"),
        ({"cmd_vel_topic": "/diff_drive/no_param"}, "cmd_vel_topic needs a name"),
        ({"publish_pose": True, "odom_frame": ""}, "odom_frame and base_frame need names"),
        ({"limits": {**NO_LIMITS, "linear_jerk_mps3": -1.0}}, "linear_jerk_mps3"),
    ],
)
def test_wrong_value_is_refused_by_name(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        params(**changes)


@pytest.mark.parametrize(
    ("value", "expected"),
    [("", ""), ("/diff_drive/no_param", ""), ("/opt/base.xml", "/opt/base.xml"), ("base.xml", "/config/base.xml")],
)
def test_parameter_file_is_absolute_or_in_the_configuration_folder(value: str, expected: str) -> None:
    assert parameter_file(params(wmx_param_file_path=value), Path("/config")) == expected


def test_limits_are_off_as_documented_and_each_can_be_set_alone() -> None:
    assert motion_limits(params().limits) is None
    limits = motion_limits(params(limits={**NO_LIMITS, "linear_jerk_mps3": 2.0}).limits)
    assert limits is not None
    assert (limits.jerk_mps3, limits.acceleration_mps2, limits.yaw_jerk_radps3) == (2.0, 1e6, 1e6)


@pytest.mark.parametrize(("name", "is_one"), [("/odom_enc", True), ("", False), ("/diff_drive/no_param", False)])
def test_empty_and_no_param_are_not_names(name: str, is_one: bool) -> None:
    assert named(name) is is_one


def test_twist_covariance_is_the_square_of_the_deviations() -> None:
    full = twist_covariance(params().odometry)
    assert full[0] == pytest.approx(0.02**2)
    assert full[35] == pytest.approx(0.05**2)
