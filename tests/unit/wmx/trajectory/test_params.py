"""The configuration of the trajectory server."""

from __future__ import annotations

from typing import Any

import pytest

from robot_stack.contract import actions, services
from robot_stack.core.config import ConfigError, config_dir, load, read_yaml, validate
from robot_stack.wmx.trajectory.params import TrajectoryServerParams, goal_limits
from robot_stack.wmx.trajectory.settings import execution_settings

DATA = read_yaml(config_dir() / "follow_joint_trajectory_server.yaml")


def test_the_documented_defaults() -> None:
    params = load(TrajectoryServerParams, "follow_joint_trajectory_server")
    assert params.joint_trajectory_action == actions.FOLLOW_JOINT_TRAJECTORY.name
    assert params.wmx_gripper_topic == services.SET_GRIPPER.name
    assert (params.joint_number, params.max_points) == (6, 1000)
    assert goal_limits(params).joints == tuple(f"joint{number}" for number in range(1, 7))
    plan = execution_settings(params).plan
    assert (sum(plan.max_velocity_radps), sum(plan.max_acceleration_radps2)) == (0, 0)
    assert (plan.speed_scaling, plan.continuous) == (1.0, ())


def test_deviations_are_limited_unless_that_is_switched_off() -> None:
    params = load(TrajectoryServerParams, "follow_joint_trajectory_server")
    limits = goal_limits(params)
    assert min(limits.path_position_rad, limits.goal_position_rad, limits.goal_velocity_radps) > 0.0
    assert execution_settings(params).plan.max_start_deviation_rad > 0.0
    validate(TrajectoryServerParams, {**DATA, "path": {"position_rad": 0.0}}, "test")


def test_continuous_joints_are_those_of_their_axes() -> None:
    params = validate(TrajectoryServerParams, {**DATA, "continuous_joints": ["joint6", "joint1"]}, "test")
    assert execution_settings(params).plan.continuous == (5, 0)


def test_names_of_fingers_have_no_axis() -> None:
    names = [*DATA["joint_name"], "picker_1_joint", "picker_2_joint"]
    params = validate(TrajectoryServerParams, {**DATA, "joint_name": names}, "test")
    assert len(params.joints) == 6


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"joint_name": ["joint1"]}, "1 names for joint_number 6"),
        ({"joint_name": ["joint1"] * 6}, "names must differ"),
        ({"joint_trajectory_action": ""}, "joint_trajectory_action"),
        ({"start": {**DATA["start"], "max_velocity_radps": [1.0]}}, "a value for each of 6 joints"),
        ({"continuous_joints": ["joint1", "joint9"]}, "continuous_joints: joint9 has no axis"),
        ({"spline": {**DATA["spline"], "max_points": 999}}, "must not be less than max_points"),
    ],
)
def test_invalid_trajectory_server_parameters_are_rejected(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        validate(TrajectoryServerParams, {**DATA, **changes}, "test")
