"""Doors for which the robot waits, from its requests to the building, for nodes that show it."""

from __future__ import annotations

from robot_stack.contract.states import DOOR_WAITS, DoorPhase


def wait_text(name: str, phase: int) -> str:
    """What the robot waits for, for people; empty in a phase in which it does not wait."""
    if phase not in DOOR_WAITS:
        return ""
    return f"waiting for door {name}" + (": no answer, open it and confirm" if phase == DoorPhase.ASKING_STAFF else "")


class DoorWaits:
    """The newest request for each door. stale_s: age from which a request does not count. Times are steady seconds."""

    def __init__(self, stale_s: float) -> None:
        self._stale_s = stale_s
        self._requests: dict[str, tuple[int, float]] = {}

    def on_request(self, name: str, phase: int, received_s: float) -> None:
        # An unbounded number of names would use up memory; the site has a few doors.
        self._requests = {key: one for key, one in self._requests.items() if received_s - one[1] <= self._stale_s}
        self._requests[name] = phase, received_s

    def waiting(self, now_s: float) -> tuple[str, int] | None:
        """Name and phase of the door for which the robot waits; None if it does not wait for one."""
        for name, (phase, received_s) in self._requests.items():
            if phase in DOOR_WAITS and 0.0 <= now_s - received_s <= self._stale_s:
                return name, phase
        return None

    def text(self, now_s: float) -> str:
        """``wait_text`` of ``waiting``."""
        waiting = self.waiting(now_s)
        return "" if waiting is None else wait_text(*waiting)
