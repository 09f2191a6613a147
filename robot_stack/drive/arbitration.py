"""Arbitration of the drive: the highest-priority source with a fresh command controls it.

The end of an emergency stop starts no motion (ISO 13850): every source must request standstill after it, and then a new
motion. A timeout is not enough: a pausing planner, or a stick whose messages have gaps, would restart the robot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

from robot_stack.contract.topics import CMD_VEL, DOCKING_CMD_VEL, DRIVE_COMMANDS, TELEOP_CMD_VEL
from robot_stack.core.geometry import ZERO_TWIST, Twist2


class Source(IntEnum):
    """Sources of velocity commands, by their rank in the contract: the greater number has priority."""

    NAVIGATION = DRIVE_COMMANDS.index(CMD_VEL)
    DOCKING = DRIVE_COMMANDS.index(DOCKING_CMD_VEL)
    TELEOP = DRIVE_COMMANDS.index(TELEOP_CMD_VEL)

    @property
    def timeout_s(self) -> float:
        """Age of its newest command after which a source loses control."""
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
    """The newest command of every source, and the source in control."""

    def __init__(self) -> None:
        # time of reception, twist, rate
        self._commands = dict.fromkeys(Source, _SILENT)
        self._must_rest: set[Source] = set()
        self._stopped = False
        self._released_s = -math.inf

    def command(self, source: Source, twist: Twist2, now_s: float, sent_ago_s: float = 0.0) -> str | None:
        """Accepts a command (m/s, rad/s, base_link) received at ``now_s``, steady seconds.

        sent_ago_s: age by its stamp; 0 without a stamp. A command that is already too old is rejected, and the previous
        one stays.

        A command that is not finite is rejected: the source then counts as requesting standstill, so that a broken
        joystick stops the robot instead of handing it to the next source. Returns the reason of a rejection, else None.
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
        if twist == ZERO_TWIST and not self._stopped and now_s - sent_ago_s >= self._released_s:
            self._must_rest.discard(source)
        return None

    def stopped(self) -> None:
        """An emergency stop is active: every source must request standstill after it before its commands count.

        Call in every tick while it is active, and ``released`` in every other.
        """
        self._stopped = True
        self._must_rest = set(Source)

    def released(self, now_s: float) -> None:
        """No emergency stop is active: a request for standstill counts from now on."""
        if self._stopped:
            self._stopped, self._released_s = False, now_s

    def must_rest(self, source: Source | None) -> bool:
        """True until the source has requested standstill after the emergency stop."""
        return source in self._must_rest

    def holder(self, now_s: float) -> Source | None:
        """The source in control at ``now_s``. A command from the future (the clock went back) does not count."""
        for source in _HIGHEST_FIRST:
            if 0.0 <= now_s - self._commands[source][0] <= source.timeout_s:
                return source
        return None

    def requested(self, now_s: float) -> tuple[Source | None, Command]:
        """(source in control, its command); (None, standstill) without any."""
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
