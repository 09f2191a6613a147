"""Whether a wheelchair is attached, and held by the latch (faults CHAIR_LOOSE and LATCH_NOT_CLOSED).

The contacts of the latch are inputs of the motion engine and are read here, not taken from a message. A confirmed latch
attaches a wheelchair. It stays attached until the docking controller states that the robot is clear of it; a false on
``/passenger_attached`` ends nothing while the latch is closed or the docking controller states otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

from robot_stack.contract import topics
from robot_stack.contract.model import SafetyAction
from robot_stack.core.limits import SpeedLimit
from robot_stack.safety.inputs import CLEAR, UNKNOWN, Finding, LatchReading, Level
from robot_stack.safety.timing import age_s


@dataclass(frozen=True, slots=True)
class LatchStatement:
    """A message of ``/docking/latch``."""

    attached: bool
    undocking: bool


class ChairWatch:
    """Tracks the contacts and the statements about the wheelchair. Steady seconds.

    attached: a wheelchair is on the latch, or has come loose and not been undocked from.
    """

    def __init__(self, attached: bool, undocking_limit: SpeedLimit, stale_s: float) -> None:
        """attached: before a restart. stale_s: an older statement permits no undocking."""
        self.attached = attached
        self._undocking_limit, self._stale_s = undocking_limit, stale_s
        self._reading: LatchReading | None = None
        self._said: bool | None = None
        self._stated: LatchStatement | None = None
        self._stated_s: float | None = None
        self._held = False

    @property
    def closed(self) -> bool:
        """The latch is confirmed closed."""
        return self._reading is not None and self._reading.confirmed

    @property
    def carried(self) -> bool:
        """The limits and the outline with a wheelchair apply: one is attached, or ``/passenger_attached`` says so."""
        return self.attached or self._said is True

    def contacts(self, reading: LatchReading | None) -> None:
        """The latch's contacts; None if they cannot be read."""
        self._reading = reading
        self._settle()

    def on_passenger(self, attached: bool) -> None:
        """A message of ``/passenger_attached``."""
        self._said = attached
        self._settle()

    def stated(self, statement: LatchStatement, now_s: float) -> None:
        self._stated, self._stated_s = statement, now_s
        self._settle()

    def _settle(self) -> None:
        if self.closed:
            self.attached = True
        elif self._stated is not None:
            self.attached = self._stated.attached
        elif self._said is not None:
            self.attached = self._said

    def loose(self, stands: bool) -> Finding:
        """The latch releases a wheelchair, or its contacts contradict each other. Call once per step.

        An opening that is commanded while the robot stands is deliberate: only LATCH_NOT_CLOSED judges it.
        """
        reading = self._reading
        if reading is None:
            return UNKNOWN
        was_held, self._held = self._held, self.attached and reading.confirmed
        if was_held and self.attached and not self._held and not (reading.opening and stands):
            return Finding(Level.PRESENT, SafetyAction.EMERGENCY_STOP, detail=reading.describe())
        return CLEAR

    def not_held(self, source: str | None, now_s: float) -> Finding:
        """A wheelchair is attached that the latch does not hold, and the robot does not undock from it.

        source: the topic of the highest fresh command, None without one.
        """
        reading = self._reading
        if reading is None:
            return UNKNOWN
        if not self._unheld(reading) or self._undocks(source, now_s):
            return CLEAR
        return Finding(Level.PRESENT, SafetyAction.STOP, detail=f"{reading.describe()}: undock")

    def undocking(self, source: str | None, now_s: float) -> SpeedLimit | None:
        """The limit of undocking from a wheelchair that the latch does not hold, else None."""
        unheld = self._reading is not None and self._unheld(self._reading)
        return self._undocking_limit if unheld and self._undocks(source, now_s) else None

    def _unheld(self, reading: LatchReading) -> bool:
        return reading.contradictory or (self.attached and not reading.confirmed)

    def _undocks(self, source: str | None, now_s: float) -> bool:
        """True if the docking controller undocks, and no other source commands the robot."""
        fresh = age_s(now_s, self._stated_s) <= self._stale_s
        stated = fresh and self._stated is not None and self._stated.undocking
        return stated and source in (None, topics.DOCKING_CMD_VEL.name)
