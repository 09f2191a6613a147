"""The dead-man pad: drives while a page sends finger positions in time. Times are steady seconds."""

from __future__ import annotations

import math

from robot_stack.core.geometry import Twist2
from robot_stack.ui.params import PadParams

STILL = Twist2(0.0, 0.0, 0.0)
# After an emergency stop a finger starts with a standstill this long [s], which the drive requires: two messages.
_STILL_FIRST_S = 0.1
# Largest drift between two clocks [s/s]; a link that stalls for a second gains a millisecond.
_DRIFT = 1e-3


class DeadManPad:
    """One page drives at a time. Silence, a late message, a lifted finger and a closed page stop the robot.

    Lateness of a message: its delay between the page's clock and its arrival, minus the smallest delay of the page
    so far. So messages that a stalled link delivers in a burst do not count as fresh commands.
    """

    def __init__(self, params: PadParams) -> None:
        self._params = params
        self._holder: int | None = None
        self._twist = STILL
        self._received_s = self._moves_from_s = -math.inf
        self._still_first_s = 0.0
        self._fastest: dict[int, tuple[float, float]] = {}  # page: least offset of its clock [s], and when
        self._ends = False

    @property
    def holder(self) -> int | None:
        """The page whose finger is on the pad."""
        return self._holder

    def press(self, client: int, x: float, y: float, turn: float, at_s: float, now_s: float) -> bool:
        """Deflections [-1, 1]; at_s: time of sending by the page's clock. False: another page drives."""
        if self._holder not in (None, client) and self._fresh(now_s):
            return False
        if self._late_s(client, at_s, now_s) > self._params.stale_s:
            return True  # neither a command nor a sign of life
        if self._holder != client:
            self._begin(client, now_s)
        self._received_s = now_s
        self._twist = self._scaled(x, y, turn)
        return True

    def lift(self, client: int) -> None:
        """The finger is gone."""
        if client == self._holder:
            self._end()

    def forget(self, client: int) -> None:
        """The page is gone."""
        self.lift(client)
        self._fastest.pop(client, None)

    def stopped(self) -> None:
        """Handles an emergency stop: every finger must start with a standstill. From any thread."""
        self._still_first_s = _STILL_FIRST_S

    def command(self, now_s: float) -> Twist2 | None:
        """The twist to publish now: a twist while the finger is down, one standstill after it, then None."""
        if self._holder is not None and not self._fresh(now_s):
            self._end()
        if self._holder is not None:
            return self._twist if now_s >= self._moves_from_s else STILL
        ends, self._ends = self._ends, False
        return STILL if ends else None

    def _fresh(self, now_s: float) -> bool:
        return 0.0 <= now_s - self._received_s <= self._params.stale_s

    def _late_s(self, client: int, at_s: float, now_s: float) -> float:
        offset_s = now_s - at_s
        least_s, since_s = self._fastest.get(client, (offset_s, now_s))
        least_s = min(offset_s, least_s + _DRIFT * max(0.0, now_s - since_s))
        self._fastest[client] = (least_s, now_s)
        return offset_s - least_s

    def _begin(self, client: int, now_s: float) -> None:
        self._holder, self._twist, self._moves_from_s = client, STILL, now_s + self._still_first_s

    def _end(self) -> None:
        self._holder, self._twist, self._ends = None, STILL, True

    def _scaled(self, x: float, y: float, turn: float) -> Twist2:
        """Limits the deflection to a circle instead of a square: the diagonal is no faster than one axis."""
        length = max(1.0, math.hypot(x, y))
        return Twist2(
            self._params.linear_mps * x / length,
            self._params.lateral_mps * y / length,
            self._params.angular_radps * turn,
        )
