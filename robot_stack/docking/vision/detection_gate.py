"""Enables marker detection: the cameras' images are searched only during docking."""

from __future__ import annotations

import math

from robot_stack.contract.states import DOCKING, DockingState


class DetectionGate:
    """linger_s: markers are still detected for this long after docking has reached DOCKED."""

    def __init__(self, linger_s: float) -> None:
        self._linger_s = linger_s
        self._wanted_s = -math.inf

    def wanted(self, state: str, now_s: float) -> bool:
        """True during a docking, and shortly after it has ended at the dock.

        state: of /docking/status, empty while stale. now_s: steady seconds.
        """
        if state in DOCKING:
            self._wanted_s = now_s
            return True
        return state == DockingState.DOCKED and now_s - self._wanted_s <= self._linger_s
