"""Rejected parameters, and the documented ways of leaving a name unset."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from robot_stack.core.config import ConfigError, config_dir, load, read_yaml, validate
from robot_stack.wmx.manipulator.params import ManipulatorStateParams, set_or_empty


def changed(**changes: Any) -> ManipulatorStateParams:
    data = read_yaml(config_dir() / "manipulator_state.yaml")
    return validate(ManipulatorStateParams, {**data, **changes}, "test")


def test_the_file():
    params = load(ManipulatorStateParams, "manipulator_state")
    assert params.joint_number == 6
    assert params.joint_feedback_rate == 500.0
    assert (params.gripper_open_value, params.gripper_close_value) == (0.0, 0.045)
    assert params.joint_name == (*(f"joint{i}" for i in range(1, 7)), "picker_1_joint", "picker_2_joint")
    assert params.topics == ("/joint_states", "", "/gazebo_position_controller/commands")
    assert (params.gripper_byte, params.gripper_bit) == (0, 0)
    assert (params.session.attempts, params.session.attempt_pause_s) == (5, 2.0)
    assert params.session.communication_retry_s == 10.0


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"joint_feedback_rate": float("nan")}, "joint_feedback_rate"),
        ({"joint_number": 7}, "must have joint_number + 2 = 9 names, has 8"),
        ({"joint_name": ["j1", "j2"]}, "must have joint_number + 2 = 8 names, has 2"),
        ({"joint_name": ["a", "a", "c", "d", "e", "f", "g", "h"]}, "joint_name: a appears more than once"),
        ({"joint_name": ["", "b", "c", "d", "e", "f", "g", "h"]}, "joint_name.0"),
        ({"gazebo_joint_topic": "/joint_states"}, "must differ"),
    ],
)
def test_refused(changes: dict[str, Any], text: str):
    with pytest.raises(ConfigError, match=text.replace("+", r"\+")) as error:
        changed(**changes)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["", "no_param", "/encoder_joint_topic/no_param", "/no_param", "/"])
def test_not_set(name: str):
    assert set_or_empty(name) == ""
    assert changed(gazebo_joint_topic=name, isaacsim_joint_topic=name).topics == ("/joint_states", "", "")
    assert changed(wmx_param_file_path=name).parameter_file(Path("/folder")) == ""


@pytest.mark.parametrize("name", ["/joint_states", "joint_states", "/no_param/x", "/x_no_param"])
def test_set(name: str):
    assert set_or_empty(name) == name


def test_parameter_files():
    assert changed(wmx_param_file_path="wmx/arm.xml").parameter_file(Path("/folder")) == "/folder/wmx/arm.xml"
    assert changed(wmx_param_file_path="/home/a.xml").parameter_file(Path("/folder")) == "/home/a.xml"
