"""The nodes that can be replayed alone, and why the others cannot."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from robot_stack.contract import frames, topics
from robot_stack.contract.model import EVERY_NODE, Topic
from robot_stack.contract.states import MissionState
from sim.replay.recorded import Recorded
from sim.scheduler.decoding import decoder

# Bulk topics of a lower rate than this share of their own were thinned by the recorder.
_COMPLETE: Final = 0.7
NOT_COMPARED: Final = (topics.HEARTBEAT, topics.DIAGNOSTICS)
"""Outputs that contain computing times."""


@dataclass(frozen=True, slots=True)
class Replayed:
    """A node whose inputs are topics alone.

    clock: an output of its own timer, which shows the timer's phase; None if no output depends on the timer.
    integrates: outputs that depend on everything since the node's start. unused: inputs that it does not need if the
    others are there. calls: why services or actions, which are not recorded, determine the recorded outputs; empty if
    they do not.
    """

    clock: Topic | None
    integrates: tuple[Topic, ...] = ()
    unused: tuple[Topic, ...] = ()
    calls: Callable[[Recorded], str] = lambda _: ""


def _mission_goals(recorded: Recorded) -> str:
    read = decoder(topics.MISSION_STATUS.type)
    states = {read(item.data).state for item in recorded.of(topics.MISSION_STATUS)}
    if states <= {MissionState.IDLE.value}:
        return ""
    return "a mission sent goals by the action /navigate_to_pose, which is not recorded"


REPLAYED: Final[Mapping[str, Replayed]] = {
    "swerve_controller": Replayed(topics.CMD_VEL_LIMITED, integrates=(topics.ODOM, topics.TF)),
    # Without a mission there is no limit of one.
    "navigation_controller": Replayed(topics.CMD_VEL, unused=(topics.MISSION_VELOCITY_LIMIT,), calls=_mission_goals),
    "costmap_server": Replayed(None),
    "perception_pipeline": Replayed(None, integrates=(topics.SPACE, topics.PEOPLE), unused=(topics.LIDAR_POINTS,)),
    "ndt_localization": Replayed(
        topics.LOCALIZATION_QUALITY, integrates=(topics.CURRENT_POSE, topics.LOCALIZATION_POSE, topics.TF)
    ),
}

_ENGINE: Final = "reads the motion engine, which is not recorded"
_DEVICE: Final = "a driver: what its device delivers is not recorded"
NOT_REPLAYED: Final[Mapping[str, str]] = {
    "safety_monitor": f"{_ENGINE}, as the nodes' records in shared memory and calls of /safety/reset are not",
    "swerve_hardware_interface": _ENGINE,
    "emergency_stop_button": _ENGINE,
    "docking_controller": f"{_ENGINE}, and serves actions, which are not recorded",
    "mission_manager": "calls actions and serves requests, which are not recorded, and reads its journal",
    "aruco_detector": "camera images are recorded only while docking, and thinned",
    "ehmi_bridge": "reads the display's answers on the serial line, which are not recorded",
    "touch_ui": "requests of its pages are not recorded",
    "system_monitor": "reads the computer's load and its processes, which are not recorded",
    "fleet_agent": "exchanges messages with the fleet's broker, which are not recorded",
    "remote_view": "its outputs, the copies for remote viewers, are not recorded",
    "diff_drive_controller": _ENGINE,
    "follow_joint_trajectory_server": _ENGINE,
    "manipulator_state": _ENGINE,
    "wmx_ros2_general_node": _ENGINE,
    "black_box": "has no outputs but files",
    "recorder": "has no outputs but files",
}


def reason_not_replayed(node: str) -> str:
    """Of a node that is not in ``REPLAYED``: NOT_REPLAYED names those that are no drivers."""
    return NOT_REPLAYED.get(node, _DEVICE)


def inputs_of(node: str) -> list[Topic]:
    return [row for row in topics.TOPICS if (node in row.subscribers or EVERY_NODE in row.subscribers) and _plain(row)]


def outputs_of(node: str) -> list[Topic]:
    return [row for row in topics.TOPICS if node in row.publishers and row not in topics.REMOTE_COPIES]


def rows_of(node: str) -> list[Topic]:
    """Everything that the replay of a node reads from a recording."""
    extra = [topics.HEARTBEAT, topics.CLOCK, topics.MISSION_STATUS]
    return list(dict.fromkeys([*inputs_of(node), *outputs_of(node), *extra]))


def incomplete_inputs(node: str, recorded: Recorded) -> list[str]:
    """Inputs that were not recorded completely, each with the reason.

    One on demand, which the node has only sometimes, may lack.
    """
    found = []
    for row in inputs_of(node):
        if row in REPLAYED[node].unused:
            continue
        if row.name in recorded.changed:
            found.append(f"{row.name} {recorded.changed[row.name]}")
        elif row.name not in recorded.topics and not (row.on_demand and node in row.sometimes):
            found.append(f"{row.name} is not recorded")
        elif row.bulk and (rate := _thinned_hz(row, recorded)) is not None:
            found.append(f"{row.name} is recorded with {rate:.1f} Hz of {row.rate_hz:g} Hz")
    return found


def is_own(row: Topic, node: str, message: Any) -> bool:
    """True if this message of a row with several publishers is of this node."""
    if row is topics.DEPARTURE_WARNING:
        return bool(message.frame_id == node)
    if row is topics.TF:
        return bool(message.transforms[0].header.frame_id == frames.MAP) == (node == "ndt_localization")
    return True


def _thinned_hz(row: Topic, recorded: Recorded) -> float | None:
    """The recorded rate of a row of a rate that it does not reach; None for a complete one."""
    if row.rate_hz is None:
        return None
    items = recorded.of(row)
    if len(items) < 2:
        return 0.0
    rate_hz = 1e9 * (len(items) - 1) / max(items[-1].received_ns - items[0].received_ns, 1)
    return rate_hz if rate_hz < _COMPLETE * row.rate_hz else None


def _plain(row: Topic) -> bool:
    return row not in (topics.CLOCK, *NOT_COMPARED) and row not in topics.REMOTE_COPIES
