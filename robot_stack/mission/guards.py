"""What speaks against going: each function answers with a sentence for people, empty if nothing does."""

from __future__ import annotations

from collections.abc import Mapping

from robot_stack.contract.faults import BY_CODE
from robot_stack.contract.model import SafetyAction
from robot_stack.core.geometry import Pose2
from robot_stack.mission.events import Inputs
from robot_stack.mission.model import Kind, Mission

_BATTERY_FAULTS = ("BATTERY_LOW", "BATTERY_CRITICAL")


def finite(pose: Pose2 | None) -> Pose2 | None:
    """The pose if it can be used."""
    return pose if pose is not None and pose.is_finite() else None


def undockable(mission: Mission, docks: Mapping[str, str], passenger_attached: bool) -> str:
    """Names the first waypoint at which docking, undocking or driving on cannot be.

    docks: kind of each dock by its id.
    """
    aboard, station = passenger_attached, ""
    for waypoint in mission.waypoints:
        where, kind, dock_id = (
            f"waypoint {waypoint.name!r} of {mission.id!r}",
            waypoint.action.kind,
            waypoint.action.dock_id,
        )
        if kind is Kind.DOCK:
            if dock_id not in docks:
                return f"{where}: there is no dock {dock_id!r}; known: {', '.join(sorted(docks)) or 'none'}"
            if aboard or station:
                held = f"docked to {station!r}" if station else "carrying a wheelchair"
                return f"{where} asks to dock to {dock_id!r}, but the robot is already {held} then: undock first"
            aboard, station = docks[dock_id] == "wheelchair", dock_id if docks[dock_id] == "station" else ""
        elif kind is Kind.UNDOCK:
            if not (aboard or station):
                return f"{where} asks to undock, but no wheelchair is attached then and no dock comes before"
            aboard, station = False, ""
        elif station:
            return f"{where} leaves the dock {station!r} without an undock before"
    return ""


def battery_low(inputs: Inputs, minimum: float) -> str:
    """An unknown charge is not held against the robot: the safety monitor judges a silent battery."""
    fault = next((code for code in _BATTERY_FAULTS if code in inputs.faults), "")
    if fault:
        return f"{fault} is active: no new mission before the robot is charged"
    if inputs.battery < minimum:  # false for NaN
        return f"battery at {inputs.battery:.0%}, a new mission needs {minimum:.0%}"
    return ""


def held_by(inputs: Inputs) -> str:
    """Why the robot cannot be expected to move although the mission is under way."""
    if inputs.pose is None:
        return "waiting for pose: no fresh /current_pose"
    if not inputs.pose.is_finite():
        return "waiting for pose: /current_pose is not finite"
    if not inputs.safety_known:
        return "held: no fresh /safety/status"
    stops = [code for code in inputs.faults if code in BY_CODE and BY_CODE[code].action >= SafetyAction.STOP]
    return f"held by safety: {', '.join(stops)}" if stops else ""
