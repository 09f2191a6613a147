"""Who holds the drive: of the sources that command it, the highest one that has spoken lately."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

from robot_stack.core.geometry import ZERO_TWIST, Twist2


class Source(IntEnum):
    """Sources of velocity commands; the greater number goes first."""

    NAVIGATION = 0
    DOCKING = 1
    TELEOP = 2


_HIGHEST_FIRST = tuple(sorted(Source, reverse=True))


@dataclass(frozen=True, slots=True)
class Wish:
    """A velocity command, base_link. rate: how it has changed since the command before (m/s2, rad/s2). age_s: since it
    was received."""

    twist: Twist2 = ZERO_TWIST
    rate: Twist2 = ZERO_TWIST
    age_s: float = 0.0


NO_WISH = Wish()
_SILENT = (-math.inf, ZERO_TWIST, ZERO_TWIST)


class Arbiter:
    """The newest command of every source, and who holds the drive."""

    def __init__(self, timeout_s: float) -> None:
        """timeout_s: a source whose newest command is older than this no longer holds the drive."""
        self._timeout_s = timeout_s
        # time of reception, twist, rate
        self._commands = dict.fromkeys(Source, _SILENT)

    def command(self, source: Source, twist: Twist2, now_s: float) -> str | None:
        """Takes a command (m/s, rad/s, base_link) received at ``now_s``, steady seconds.

        A command that is not finite is refused: the source then asks for standstill, so that a broken joystick stops
        the robot instead of handing it to the next source. Returns the reason of the refusal, None if it was taken.
        """
        for name, value in (("linear.x", twist.vx), ("linear.y", twist.vy), ("angular.z", twist.omega)):
            if not math.isfinite(value):
                self._commands[source] = (now_s, ZERO_TWIST, ZERO_TWIST)
                return f"{source.name.lower()} command refused: {name} must be finite, is {value}"
        before_s, before, _ = self._commands[source]
        known = 0.0 < now_s - before_s <= self._timeout_s
        rate = _rate(before, twist, now_s - before_s) if known else ZERO_TWIST
        self._commands[source] = (now_s, twist, rate)
        return None

    def holder(self, now_s: float) -> Source | None:
        """The source that holds the drive at ``now_s``. A command from the future (time ran back) does not count."""
        for source in _HIGHEST_FIRST:
            if 0.0 <= now_s - self._commands[source][0] <= self._timeout_s:
                return source
        return None

    def wish(self, now_s: float) -> tuple[Source | None, Wish]:
        """(holder, its command); (None, standstill) when nobody holds the drive."""
        source = self.holder(now_s)
        if source is None:
            return None, NO_WISH
        received_s, twist, rate = self._commands[source]
        return source, Wish(twist, rate, now_s - received_s)


def _rate(before: Twist2, after: Twist2, seconds: float) -> Twist2:
    rate = Twist2(
        (after.vx - before.vx) / seconds, (after.vy - before.vy) / seconds, (after.omega - before.omega) / seconds
    )
    return rate if rate.is_finite() else ZERO_TWIST  # the difference of two huge commands
