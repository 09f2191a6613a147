"""The latch: its commands, its inputs, and whether a command succeeded."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class LatchCommand(Enum):
    """Outputs of the latch. HOLD (both off) leaves it as it is."""

    HOLD = "hold"
    CLOSE = "close"
    OPEN = "open"


@dataclass(frozen=True, slots=True)
class LatchInputs:
    """Both inputs, and whether the engine could be read at all."""

    known: bool = False
    closed: bool = False
    open: bool = False

    @property
    def confirmed(self) -> bool:
        """Closed, plausibly: not open at the same time."""
        return self.known and self.closed and not self.open


class Motion(Enum):
    """State of one movement of the latch."""

    MOVING = "moving"
    CONFIRMED = "confirmed"
    FAILED = "failed"


class LatchMotion:
    """One movement of the latch, from the command to its confirmation."""

    def __init__(self, command: LatchCommand, now_s: float, timeout_s: float) -> None:
        self._wanted = command
        self._deadline_s = now_s + timeout_s
        self.state = Motion.MOVING

    @property
    def command(self) -> LatchCommand:
        """The outputs: on while it moves, off once it has arrived or given up."""
        return self._wanted if self.state is Motion.MOVING else LatchCommand.HOLD

    def update(self, inputs: LatchInputs, now_s: float) -> Motion:
        if self.state is Motion.MOVING:
            if inputs.known and self._arrived(inputs):
                self.state = Motion.CONFIRMED
            elif not now_s <= self._deadline_s:
                self.state = Motion.FAILED
        return self.state

    def _arrived(self, inputs: LatchInputs) -> bool:
        if self._wanted is LatchCommand.CLOSE:
            return inputs.confirmed
        return inputs.open and not inputs.closed

    def problem(self, inputs: LatchInputs) -> str:
        """The reason of the failure, in words."""
        verb = "close" if self._wanted is LatchCommand.CLOSE else "open"
        if not inputs.known:
            return f"the latch did not {verb}: the engine's inputs cannot be read"
        return f"the latch did not {verb}: inputs closed={int(inputs.closed)}, open={int(inputs.open)}"


class LatchKeeper:
    """Tracks from the inputs whether a wheelchair is attached.

    A closed latch attaches, and so does one that may hold: it was closing and has not opened again, or it is found
    half closed. Only backing off detaches: until the robot is clear, the passenger counts.
    """

    def __init__(self) -> None:
        self.attached: bool | None = None
        self.holding = False  # by the last inputs

    def recall(self, attached: bool) -> None:
        """Restores the state from before a restart. A chair no longer held by the latch was released meanwhile."""
        if attached:
            self.attached = self.holding = True

    def may_hold(self) -> None:
        """A docking has ended while the latch was closing."""
        self.attached = True

    def released(self) -> None:
        """The robot is clear of the wheelchair."""
        self.attached = False

    def update(self, inputs: LatchInputs, *, may_open: bool) -> bool:
        """Updates from the inputs. Returns True, once, if the latch opens without a command.

        may_open: the robot is undocking, or a latch that was not confirmed is opened again.
        """
        if not inputs.known:
            return False
        closed = inputs.confirmed
        lost = self.holding and not closed and not may_open
        if closed and not may_open:
            self.attached = True
        elif self.attached is None:
            self.attached = not inputs.open
        self.holding = closed
        return lost
