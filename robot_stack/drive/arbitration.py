"""Who holds the drive: of the sources that command it, the highest one that has spoken lately.

The end of an emergency stop starts no motion (ISO 13850): a source that commands one right then, a stick that is held
or a planner that has gone on, must first ask for standstill or fall silent, and then ask anew.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

from robot_stack.contract.topics import CMD_VEL, DOCKING_CMD_VEL, DRIVE_COMMANDS, TELEOP_CMD_VEL
from robot_stack.core.geometry import ZERO_TWIST, Twist2


class Source(IntEnum):
    """Sources of velocity commands, by their rank in the contract: the greater number goes first."""

    NAVIGATION = DRIVE_COMMANDS.index(CMD_VEL)
    DOCKING = DRIVE_COMMANDS.index(DOCKING_CMD_VEL)
    TELEOP = DRIVE_COMMANDS.index(TELEOP_CMD_VEL)

    @property
    def timeout_s(self) -> float:
        """A source whose newest command is older than this no longer holds the drive."""
        return DRIVE_COMMANDS[self].stale_limit_s


_HIGHEST_FIRST = tuple(sorted(Source, reverse=True))


@dataclass(frozen=True, slots=True)
class Command:
    """A velocity command, base_link. rate: how it has changed since the command before (m/s2, rad/s2). age_s: since it
    was received."""

    twist: Twist2 = ZERO_TWIST
    rate: Twist2 = ZERO_TWIST
    age_s: float = 0.0


NO_COMMAND = Command()
_SILENT = (-math.inf, ZERO_TWIST, ZERO_TWIST)


class Arbiter:
    """The newest command of every source, and who holds the drive."""

    def __init__(self) -> None:
        # time of reception, twist, rate
        self._commands = dict.fromkeys(Source, _SILENT)
        self._must_rest: set[Source] = set()

    def command(self, source: Source, twist: Twist2, now_s: float, sent_ago_s: float = 0.0) -> str | None:
        """Takes a command (m/s, rad/s, base_link) received at ``now_s``, steady seconds.

        sent_ago_s: by its stamp; without a stamp the time of reception has to do. A command that is too old already is
        refused, and the one before stands.

        A command that is not finite is refused: the source then asks for standstill, so that a broken joystick stops
        the robot instead of handing it to the next source. Returns the reason of the refusal, None if it was taken.
        """
        if sent_ago_s > source.timeout_s:
            return f"{source.name.lower()} command refused: {sent_ago_s:.2f} s old, at most {source.timeout_s} s"
        for name, value in (("linear.x", twist.vx), ("linear.y", twist.vy), ("angular.z", twist.omega)):
            if not math.isfinite(value):
                self._commands[source] = (now_s, ZERO_TWIST, ZERO_TWIST)
                return f"{source.name.lower()} command refused: {name} must be finite, is {value}"
        before_s, before, _ = self._commands[source]
        known = 0.0 < now_s - before_s <= source.timeout_s
        rate = _rate(before, twist, now_s - before_s) if known else ZERO_TWIST
        self._commands[source] = (now_s, twist, rate)
        return None

    def stopped(self, now_s: float) -> None:
        """An emergency stop is in force: who commands a motion now must rest after it before it is obeyed.

        Call at every tick as long as it is, and ``released`` at every other.
        """
        self._must_rest = {source for source in Source if not self._rests(source, now_s)}

    def released(self, now_s: float) -> None:
        """No emergency stop is in force: a source that rests now may ask again."""
        self._must_rest = {source for source in self._must_rest if not self._rests(source, now_s)}

    def must_rest(self, source: Source | None) -> bool:
        """True while a source has not asked for standstill since the emergency stop."""
        return source in self._must_rest

    def _rests(self, source: Source, now_s: float) -> bool:
        received_s, twist, _ = self._commands[source]
        return twist == ZERO_TWIST or not 0.0 <= now_s - received_s <= source.timeout_s

    def holder(self, now_s: float) -> Source | None:
        """The source that holds the drive at ``now_s``. A command from the future (time ran back) does not count."""
        for source in _HIGHEST_FIRST:
            if 0.0 <= now_s - self._commands[source][0] <= source.timeout_s:
                return source
        return None

    def requested(self, now_s: float) -> tuple[Source | None, Command]:
        """(holder, its command); (None, standstill) when nobody holds the drive."""
        source = self.holder(now_s)
        if source is None:
            return None, NO_COMMAND
        received_s, twist, rate = self._commands[source]
        return source, Command(twist, rate, now_s - received_s)


def _rate(before: Twist2, after: Twist2, seconds: float) -> Twist2:
    rate = Twist2(
        (after.vx - before.vx) / seconds, (after.vy - before.vy) / seconds, (after.omega - before.omega) / seconds
    )
    return rate if rate.is_finite() else ZERO_TWIST  # the difference of two huge commands
