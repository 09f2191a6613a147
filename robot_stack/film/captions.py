"""Captions of a film."""

from __future__ import annotations

_DOCKING = {
    "APPROACH": "driving up to the wheelchair",
    "SEARCH": "looking for the wheelchair's markers",
    "SERVOING": "docking to the wheelchair",
    "FINE_ALIGN": "docking, the last centimetres",
    "FAILED": "docking failed",
}
_MISSION = {
    "IDLE": "waiting",
    "PAUSED": "paused",
    "COMPLETED": "done",
    "FAILED": "the mission failed",
    "ABORTED": "aborted",
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
