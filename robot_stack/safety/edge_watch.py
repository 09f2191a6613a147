"""Whether the safety edge is pressed (fault CONTACT).

The edge's relay stops the motion engine by itself; this watch turns the contact into an emergency stop that lasts until
a reset. The inputs are normally closed, so that a cut wire reads as pressed. A pressed input counts from its first
reading, because the relay has stopped the engine by then. Free counts after ``debounce_s`` of readings without a break.
Inputs that cannot be read neither raise nor clear the row: the same condition raises DRIVE_FAULT.
"""

from __future__ import annotations

from robot_stack.contract.model import SafetyAction
from robot_stack.safety.inputs import CLEAR, UNKNOWN, EdgeReading, Finding, Level
from robot_stack.safety.timing import Hold


class EdgeWatch:
    """Tracks the inputs of the safety edge. Steady seconds. fitted: the robot has an edge."""

    def __init__(self, fitted: bool, debounce_s: float) -> None:
        self._fitted, self._debounce_s = fitted, debounce_s
        self._reading: EdgeReading | None = None
        self._pressed: EdgeReading | None = None  # the newest pressed reading since the last step, or until free
        self._free_for = Hold()

    def received(self, reading: EdgeReading | None, now_s: float) -> None:
        """The present inputs; None if they cannot be read."""
        self._reading = reading
        free_for_s = self._free_for.update(reading is not None and not reading.pressed, now_s)
        if reading is not None and reading.pressed:
            self._pressed = reading
        elif free_for_s is not None and free_for_s >= self._debounce_s:
            self._pressed = None

    def judge(self) -> Finding:
        """The finding on the edge now."""
        if not self._fitted:
            return CLEAR
        if self._pressed is not None:
            return Finding(Level.PRESENT, SafetyAction.EMERGENCY_STOP, detail=self._pressed.describe())
        return UNKNOWN if self._reading is None else CLEAR
