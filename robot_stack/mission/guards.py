"""Conditions against driving: each function returns a sentence for people, empty if there is none."""

from __future__ import annotations

from robot_stack.contract.faults import BY_CODE
from robot_stack.contract.model import SafetyAction
from robot_stack.contract.states import DOCKING
from robot_stack.core.geometry import Pose2
from robot_stack.mission.events import Inputs

_BATTERY_FAULTS = ("BATTERY_LOW", "BATTERY_CRITICAL")
# People walk past a robot that stands.
_PASSES_BY = frozenset({"COLLISION_IMMINENT"})
# The safety monitor stops all motion except that of an undocking.
_PERMIT_UNDOCKING = frozenset({"LATCH_NOT_CLOSED"})


def finite(pose: Pose2 | None) -> Pose2 | None:
    """The pose if it can be used."""
    return pose if pose is not None and pose.is_finite() else None


def battery_low(inputs: Inputs, minimum: float) -> str:
    """An unknown charge is no reason to stay: the safety monitor handles a silent battery."""
    fault = next((code for code in _BATTERY_FAULTS if code in inputs.faults), "")
    if fault:
        return f"{fault} is active: no new mission before the robot is charged"
    if inputs.battery < minimum:  # false for NaN
        return f"battery at {inputs.battery:.0%}, a new mission needs {minimum:.0%}"
    return ""


def battery_critical(inputs: Inputs) -> bool:
    return "BATTERY_CRITICAL" in inputs.faults


def needs_a_person(inputs: Inputs) -> bool:
    """Something happened to a robot that stands, so that only a person lets it go on."""
    faults = set(stopping_faults(inputs)) - _PASSES_BY
    return bool(faults) or battery_critical(inputs) or inputs.manual or not inputs.safety_known


def lost(inputs: Inputs) -> bool:
    return "LOCALIZATION_LOST" in inputs.faults


def not_latched(inputs: Inputs) -> str:
    """A latch that may hold is no finished docking, and permits no other one."""
    return "the latch does not hold the wheelchair: undock first" if _PERMIT_UNDOCKING & set(inputs.faults) else ""


def held_by(inputs: Inputs, *, undocks: bool = False) -> str:
    """Why the robot cannot move at present although the mission is active. undocks: it is to leave a wheelchair."""
    if inputs.pose is None:
        return "waiting for pose: no fresh /current_pose"
    if not inputs.pose.is_finite():
        return "waiting for pose: /current_pose is not finite"
    if not inputs.safety_known:
        return "held: no fresh /safety/status"
    stops = [code for code in stopping_faults(inputs) if not (undocks and code in _PERMIT_UNDOCKING)]
    return f"held by safety: {', '.join(stops)}" if stops else ""


def held_in_ride(inputs: Inputs) -> str:
    """As ``held_by``, and during a docking by another client: each of the two goals would preempt the other."""
    docking = inputs.docking_state in DOCKING
    return held_by(inputs) or ("held: docking_controller executes a goal of another client" if docking else "")


def stopping_faults(inputs: Inputs) -> tuple[str, ...]:
    """The active faults that may keep the robot standing."""
    return tuple(code for code in inputs.faults if code in BY_CODE and BY_CODE[code].action >= SafetyAction.STOP)
