"""The published axis states, the answers of services, and valid parameters."""

from __future__ import annotations

from typing import Any

import pytest

from robot_stack.core.config import ConfigError, config_dir, load, read_yaml
from robot_stack.wmx.api import EngineState
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.general.answers import Answer, failure, joined, state_name
from robot_stack.wmx.general.axis_state import axis_state
from robot_stack.wmx.general.params import GeneralParams
from tests.unit.wmx_general.snapshots import standing

FIELDS = [
    *("amp_alarm", "servo_on", "home_done", "in_pos", "negative_ls", "positive_ls", "home_switch"),
    *("pos_cmd", "velocity_cmd", "actual_pos", "actual_velocity", "actual_torque"),
]
FLAGS = {
    "amp_alarm": Flag.AMP_ALARM,
    "servo_on": Flag.SERVO_ON,
    "home_done": Flag.HOME_DONE,
    "in_pos": Flag.IN_POS,
    "negative_ls": Flag.NEGATIVE_LS,
    "positive_ls": Flag.POSITIVE_LS,
    "home_switch": Flag.HOME_SWITCH,
}
REALS = {
    "pos_cmd": Real.POS_CMD,
    "velocity_cmd": Real.VELOCITY_CMD,
    "actual_pos": Real.ACTUAL_POS,
    "actual_velocity": Real.ACTUAL_VELOCITY,
    "actual_torque": Real.ACTUAL_TORQUE,
}


@pytest.mark.parametrize("name", FLAGS)
def test_a_flag_shows_on_its_axis_and_in_its_field_alone(name: str) -> None:
    snapshot = standing(3)
    snapshot.flags[Flag.SERVO_ON] = 0
    snapshot.flags[FLAGS[name], 1] = 5  # the engine may write any number for true
    fields = axis_state(snapshot, 3, (1.0, 1.0, 1.0))
    assert fields[name].tolist() == [0, 1, 0]
    assert all(not any(fields[other]) for other in FLAGS if other != name)


@pytest.mark.parametrize("name", REALS)
def test_a_number_shows_on_its_axis_and_in_its_field_alone(name: str) -> None:
    snapshot = standing(3)
    snapshot.reals[REALS[name], 1] = -1.25
    fields = axis_state(snapshot, 2, (1.0, 200.0))  # N m; the vendor's status has percent of the rated torque
    assert fields[name].tolist() == [0.0, -2.5 if name == "actual_torque" else -1.25]
    assert [fields[field].typecode for field in FIELDS] == ["i"] * 7 + ["d"] * 5
    assert {len(values) for values in fields.values()} == {2}
    assert sorted(fields) == sorted(FIELDS)
    assert all(not any(fields[other]) for other in REALS if other != name)


def test_entries_end_with_a_semicolon_each_and_one_failure_is_enough() -> None:
    good, bad = Answer(True, "Set axis 0 on"), failure("Failed to set axis 1 on", 1568, lambda code: f"text {code}")
    assert bad.message == "Failed to set axis 1 on. Error=1568 (text 1568)"
    assert joined([good]) == Answer(True, "Set axis 0 on; ")
    assert joined([good, bad, good]) == Answer(
        False, "Set axis 0 on; Failed to set axis 1 on. Error=1568 (text 1568); Set axis 0 on; "
    )


def test_names_of_engine_states() -> None:
    assert [state_name(state) for state in (*EngineState, 9)] == [
        *("Idle", "Running", "Communicating", "Shutdown", "Unknown"),
        "Invalid",
    ]


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"axis_count": 2, "rated_torque_nm": [1.0]}, "rated_torque_nm must have axis_count = 2 entries, has 1"),
        ({"axis_count": 2, "rated_torque_nm": []}, "rated_torque_nm must have axis_count = 2 entries, has 0"),
        ({"axis_count": 3}, "rated_torque_nm must have axis_count = 3 entries, has 2"),
        ({"rated_torque_nm": [1.0, 0.0]}, "rated_torque_nm"),
    ],
)
def test_bad_parameters(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        load(GeneralParams, "wmx_ros2_general_node", changes)


def test_every_parameter_is_in_the_file() -> None:
    assert set(read_yaml(config_dir() / "wmx_ros2_general_node.yaml")) == set(GeneralParams.model_fields)
