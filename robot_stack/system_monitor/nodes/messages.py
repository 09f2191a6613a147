"""The system monitor's values as messages and back."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Point, Pose, Quaternion

from custom_msgs.msg import MissionStatus, RobotStatus
from robot_stack.middleware.report import diagnostic_status
from robot_stack.system_monitor.diagnostics_tree import Entry, Level
from robot_stack.system_monitor.robot_status import Battery, Mission, Summary, current_mission

_NAN = math.nan
UNKNOWN_POSE = Pose(position=Point(x=_NAN, y=_NAN, z=_NAN), orientation=Quaternion(x=_NAN, y=_NAN, z=_NAN, w=_NAN))
_LEVELS = {level: bytes([level]) for level in Level}


def battery_of(message: Any) -> Battery:
    return Battery(message.voltage, message.percentage, message.current)


def mission_of(message: MissionStatus) -> Mission:
    mission = Mission(
        message.mission_id, message.current_waypoint, message.waypoints_completed, message.total_waypoints
    )
    return current_mission(message.state, mission)


def fill(message: RobotStatus, summary: Summary, pose: Pose) -> None:
    """Sets every field but the header of a reused message, because creating one costs as much as sending it."""
    message.battery_voltage = summary.battery.voltage_v
    message.battery_percent = summary.battery.percent
    message.battery_current = summary.battery.current_a
    message.localization_quality = summary.quality
    message.pose = pose
    message.safety_state = summary.safety.shown
    message.active_faults = summary.safety.faults
    message.mission_id = summary.mission.mission_id
    message.current_waypoint = summary.mission.waypoint
    message.waypoints_completed = summary.mission.completed
    message.total_waypoints = summary.mission.total
    message.cpu_usage_percent = summary.usage.cpu_percent
    message.memory_usage_percent = summary.usage.memory_percent
    message.disk_usage_percent = summary.usage.disk_percent


def status(name: str, level: Level, message: str, values: Iterable[tuple[str, str]]) -> DiagnosticStatus:
    return diagnostic_status(name, _LEVELS[level], message, values)


def level_of(message: DiagnosticStatus) -> int:
    """rclpy represents a byte as bytes."""
    return int.from_bytes(message.level, "little")


def tree_status(entry: Entry) -> DiagnosticStatus:
    """An entry of the tree; a leaf keeps its original values."""
    if entry.payload is None:
        return status(entry.path, entry.level, entry.message, entry.children)
    leaf = entry.payload
    leaf.name, leaf.level = entry.path, _LEVELS[entry.level]
    return leaf
