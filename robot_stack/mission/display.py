"""Which state of the external display (EHMIState.state_num) goes with what the mission manager does."""

from __future__ import annotations

from enum import IntEnum

from robot_stack.mission.events import Inputs
from robot_stack.mission.record import Record
from robot_stack.mission.states import UNDER_WAY, State


class Display(IntEnum):
    """The states of the display that a mission can ask for."""

    IDLE = 1
    NAVIGATING = 2
    PAUSED = 3
    ERROR = 5
    EMERGENCY_STOP = 6
    LOCALIZATION_LOST = 8
    LOW_BATTERY = 9
    OBSTACLE = 10
    PASSENGER_ONBOARD = 24
    TRANSPORT = 25
    DESTINATION_REACHED = 26


_OBSTACLE_FAULTS = frozenset({"COLLISION_IMMINENT", "OBSTACLE_NEAR"})


def display_of(record: Record, inputs: Inputs, *, emergency: bool, battery_low: bool) -> Display:
    if emergency:
        return Display.EMERGENCY_STOP
    if record.state in UNDER_WAY:
        return _under_way(record, inputs)
    if record.state in (State.PAUSED, State.STOPPED):
        return Display.PAUSED
    if record.state is State.FAILED:
        return Display.ERROR
    if record.passenger_attached:
        return Display.DESTINATION_REACHED if record.state is State.COMPLETED else Display.PASSENGER_ONBOARD
    return Display.LOW_BATTERY if battery_low else Display.IDLE


def _under_way(record: Record, inputs: Inputs) -> Display:
    if inputs.pose is None or "LOCALIZATION_LOST" in inputs.faults:
        return Display.LOCALIZATION_LOST
    if _OBSTACLE_FAULTS.intersection(inputs.faults):
        return Display.OBSTACLE
    return Display.TRANSPORT if record.passenger_attached else Display.NAVIGATING
