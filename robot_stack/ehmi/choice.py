"""Selects the state of the display from the requested state and the bridge's own inputs.

The requested state applies unless an input contradicts it: a stop, a silent safety monitor, a passenger on board.
Without a request (the bridge has just started, or the requesting node is gone) the state follows from mission,
docking and passenger.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from robot_stack.contract.display import Display
from robot_stack.contract.states import DockingState, MissionState


class Safety(Enum):
    """State of the safety monitor."""

    UNKNOWN = "never received"
    FRESH = "fresh"
    SILENT = "silent"


@dataclass(frozen=True, slots=True)
class Situation:
    """emergency: the stop latch of the node. asked: the last requested state, None without one.

    mission, docking: states of /mission/status and of /docking/status, empty while unknown.
    """

    emergency: bool
    safety: Safety
    asked: int | None
    passenger: bool
    mission: str = ""
    docking: str = ""


# The display must not show a robot with a passenger as empty.
_WITH_PASSENGER = {
    Display.IDLE: Display.PASSENGER_ONBOARD,
    Display.NAVIGATING: Display.TRANSPORT,
    Display.APPROACHING_CHAIR: Display.TRANSPORT,
}
_OF_DOCKING: dict[str, Display] = {
    DockingState.APPROACH: Display.APPROACHING_CHAIR,
    DockingState.SEARCH: Display.DOCKING,
    DockingState.SERVOING: Display.DOCKING,
    DockingState.FINE_ALIGN: Display.DOCKING,
    DockingState.FAILED: Display.DOCKING_FAILED,
}
_OF_MISSION: dict[str, Display] = {
    MissionState.RUNNING: Display.NAVIGATING,
    MissionState.WAITING: Display.PAUSED,
    MissionState.PAUSED: Display.PAUSED,
    MissionState.FAILED: Display.ERROR,
}


def choose(situation: Situation) -> Display:
    """The state to show now."""
    if situation.emergency:
        return Display.EMERGENCY_STOP
    if situation.safety is Safety.UNKNOWN:
        return Display.OFF
    if situation.safety is Safety.SILENT:
        return Display.ERROR
    state = Display(situation.asked) if situation.asked in set(Display) else _guess(situation)
    return _WITH_PASSENGER.get(state, state) if situation.passenger else state


def after_mission_manager(asked: int | None) -> int | None:
    """The request that stays once the mission manager has ended: a display that is switched off stays off."""
    return asked if asked == Display.OFF else None


def _guess(situation: Situation) -> Display:
    docking = _OF_DOCKING.get(situation.docking)
    if docking is not None:
        return docking
    mission = _OF_MISSION.get(situation.mission)
    if mission is not None:
        return mission
    docked = situation.docking == DockingState.DOCKED
    return Display.DOCKING_COMPLETE if docked and not situation.passenger else Display.IDLE
