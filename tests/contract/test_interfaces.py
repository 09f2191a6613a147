"""The interface packages against their specifications: names, order and types of every field."""

from __future__ import annotations

import importlib
from enum import StrEnum
from pathlib import Path
from typing import Any

import pytest

from robot_stack.contract.display import Display
from robot_stack.contract.states import DockingState, MissionState
from tests.contract.type_hashes import installed

ROOT = Path(__file__).resolve().parents[2]

# From the robot's topic specification: exactly these fields, in this order.
ROBOT_MESSAGES = {
    "RobotStatus": {
        "header": "std_msgs/Header",
        "battery_voltage": "float",
        "battery_percent": "float",
        "battery_current": "float",
        "localization_quality": "float",
        "pose": "geometry_msgs/Pose",
        "safety_state": "string",
        "active_faults": "sequence<string>",
        "mission_id": "string",
        "current_waypoint": "string",
        "waypoints_completed": "uint8",
        "total_waypoints": "uint8",
        "cpu_usage_percent": "float",
        "memory_usage_percent": "float",
        "disk_usage_percent": "float",
    },
    "SwerveModuleCommand": {"module_id": "uint8", "drive_velocity": "double", "steering_angle": "double"},
    "SwerveModuleCommandArray": {"header": "std_msgs/Header", "modules": "custom_msgs/SwerveModuleCommand[4]"},
    "ArucoDetection": {
        "header": "std_msgs/Header",
        "marker_id": "int32",
        "pose": "geometry_msgs/Pose",
        "quality_score": "float",
        "camera_frame": "string",
    },
    "ArucoDetectionArray": {"header": "std_msgs/Header", "detections": "sequence<custom_msgs/ArucoDetection>"},
    "DockingStatus": {
        "header": "std_msgs/Header",
        "state": "string",
        "position_error": "float",
        "orientation_error": "float",
        "visible_markers_count": "int32",
        "convergence_progress": "float",
    },
    "SafetyStatus": {
        "header": "std_msgs/Header",
        "safety_state": "string",
        "active_faults": "sequence<string>",
        "min_obstacle_distance": "float",
        "emergency_stop_active": "boolean",
    },
    "VelocityLimit": {
        "header": "std_msgs/Header",
        "max_linear_velocity": "float",
        "max_angular_velocity": "float",
        "reason": "string",
    },
    "EHMIState": {"header": "std_msgs/Header", "state_num": "uint8", "language": "string", "volume": "uint8"},
    "UICommand": {"header": "std_msgs/Header", "command_type": "string", "mission_id": "string"},
}

# From the motion engine's topic and service documents; the spelling of the gear ratio's denominator is corrected.
_AXIS_REPLY = {"success": "boolean", "message": "string"}
_INTS, _DOUBLES = "sequence<int32>", "sequence<double>"
WMX_TYPES: dict[str, list[dict[str, str]]] = {
    "msg.AxisState": [
        dict.fromkeys(
            ("amp_alarm", "servo_on", "home_done", "in_pos", "negative_ls", "positive_ls", "home_switch"), _INTS
        )
        | dict.fromkeys(("pos_cmd", "velocity_cmd", "actual_pos", "actual_velocity", "actual_torque"), _DOUBLES)
    ],
    "msg.AxisPose": [
        {"index": _INTS, "target": _DOUBLES, "profile": "string"} | dict.fromkeys(("velocity", "acc", "dec"), _DOUBLES)
    ],
    "msg.AxisVelocity": [{"index": _INTS, "profile": "string"} | dict.fromkeys(("velocity", "acc", "dec"), _DOUBLES)],
    "srv.SetEngine": [{"data": "boolean", "path": "string", "name": "string"}, _AXIS_REPLY],
    "srv.SetAxis": [{"index": _INTS, "data": _INTS}, _AXIS_REPLY],
    "srv.SetAxisGearRatio": [{"index": _INTS, "numerator": _DOUBLES, "denominator": _DOUBLES}, _AXIS_REPLY],
}

# Every closed set of states in a document: the constants must be exactly these.
CONSTANTS = {
    "DockingStatus": {"IDLE", "APPROACH", "SEARCH", "SERVOING", "FINE_ALIGN", "DOCKED", "FAILED"},
    "SafetyStatus": {"NORMAL", "DEGRADED", "COLLISION_AVOIDANCE", "EMERGENCY_STOP"},
    "RobotStatus": {"NORMAL", "DEGRADED", "EMERGENCY_STOP"},
    "UICommand": {"START_MISSION", "PAUSE", "RESUME", "ABORT", "EMERGENCY_STOP"},
}

INTERFACE_FILES = sorted(
    path
    for package in ("custom_msgs", "wmx_ros2_message", "control_msgs", "nav2_msgs", "tf2_msgs")
    for kind in ("msg", "srv", "action")
    for path in (ROOT / package / kind).glob(f"*.{kind}")
)


def _message(name: str) -> Any:
    return getattr(importlib.import_module("custom_msgs.msg"), name)


def _texts(name: str) -> dict[str, str]:
    """The string constants of a message."""
    texts = {key: getattr(_message(name), key) for key in dir(_message(name)) if key.isupper()}
    return {key: text for key, text in texts.items() if isinstance(text, str)}


def _parts(path: str) -> list[Any]:
    kind, name = path.split(".")
    interface = getattr(importlib.import_module(f"wmx_ros2_message.{kind}"), name)
    return [interface] if kind == "msg" else [interface.Request, interface.Response]


@pytest.mark.parametrize("name", ROBOT_MESSAGES)
def test_robot_message_has_the_specified_fields_in_order(name: str) -> None:
    assert list(_message(name).get_fields_and_field_types().items()) == list(ROBOT_MESSAGES[name].items())


@pytest.mark.parametrize("path", WMX_TYPES)
def test_wmx_type_has_the_specified_fields_in_order(path: str) -> None:
    fields = [list(part.get_fields_and_field_types().items()) for part in _parts(path)]

    assert fields == [list(expected.items()) for expected in WMX_TYPES[path]]


@pytest.mark.parametrize("name", CONSTANTS)
def test_state_constants_carry_their_own_names(name: str) -> None:
    assert _texts(name) == {key: key for key in CONSTANTS[name]}


@pytest.mark.parametrize(("name", "states"), [("DockingStatus", DockingState), ("MissionStatus", MissionState)])
def test_states_are_those_of_the_message(name: str, states: type[StrEnum]) -> None:
    assert {state.value for state in states} == set(_texts(name).values())


def test_ehmi_states_are_numbered_as_specified() -> None:
    """States 0 to 10 and 21 to 28; an emergency stop shows 6."""
    state = _message("EHMIState")

    assert (state.OFF, state.IDLE, state.NAVIGATING, state.PAUSED, state.CHARGING, state.ERROR) == (0, 1, 2, 3, 4, 5)
    assert (state.EMERGENCY_STOP, state.MANUAL, state.LOCALIZATION_LOST, state.LOW_BATTERY, state.OBSTACLE) == (
        6, 7, 8, 9, 10,
    )  # fmt: skip
    assert (state.APPROACHING_CHAIR, state.DOCKING, state.DOCKING_COMPLETE, state.PASSENGER_ONBOARD) == (21, 22, 23, 24)
    assert (state.TRANSPORT, state.DESTINATION_REACHED, state.PASSENGER_DISEMBARK, state.DOCKING_FAILED) == (
        25, 26, 27, 28,
    )  # fmt: skip
    assert all(getattr(state, display.name) == display for display in Display)


@pytest.mark.parametrize("path", INTERFACE_FILES, ids=lambda path: path.name)
def test_every_interface_field_has_comment(path: Path) -> None:
    """Each field has a comment with unit, frame and range; constants are explained above their group."""
    lines = [line for line in path.read_text().splitlines() if line and not line.startswith(("#", "---"))]
    fields = [line for line in lines if "=" not in line.split("#")[0]]

    assert path.read_text().startswith("# ")
    assert [line for line in fields if "# " not in line] == []


@pytest.mark.parametrize("path", INTERFACE_FILES, ids=lambda path: path.name)
def test_every_definition_is_built(path: Path) -> None:
    """A file missing in the package's CMakeLists.txt would generate no interface."""
    package, kind = path.parts[-3:-1]

    assert f"{package}/{kind}/{path.stem}" in installed(package)
