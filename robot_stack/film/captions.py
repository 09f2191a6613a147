"""Captions of a film."""

from __future__ import annotations

from robot_stack.contract.states import DockingState, MissionState

_DOCKING: dict[str, str] = {
    DockingState.APPROACH: "driving up to the wheelchair",
    DockingState.SEARCH: "looking for the wheelchair's markers",
    DockingState.SERVOING: "docking to the wheelchair",
    DockingState.FINE_ALIGN: "docking, the last centimetres",
    DockingState.FAILED: "docking failed",
}
_MISSION: dict[str, str] = {
    MissionState.IDLE: "waiting",
    MissionState.PAUSED: "paused",
    MissionState.COMPLETED: "done",
    MissionState.FAILED: "the mission failed",
    MissionState.ABORTED: "aborted",
}


def caption(mission_state: str, waypoint: str, docking_state: str, attached: bool) -> str:
    """One line about the present activity, with or without a passenger."""
    if mission_state in _MISSION:
        return _MISSION[mission_state]
    if docking_state in _DOCKING:
        # Backing off after the latch has opened is servoing too.
        return "putting the wheelchair down" if attached else _DOCKING[docking_state]
    to = f" to: {waypoint}" if waypoint else ""
    return f"carrying the passenger{to}" if attached else f"driving{to}"
