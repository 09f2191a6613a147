"""The command of the base: the newest twist, until its timeout.

Whenever the drive becomes able to move (at the start, after a fault, after an emergency stop) the command must first be
zero or silent. Otherwise a sender that missed the stop would restart the base. Silence counts from this moment, because
a paused node receives no messages, whatever the sender does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass


class BadTwist(Exception):
    """An invalid twist. The message names field and value."""


class OldTwist(Exception):
    """A twist that was too old at its reception. The message names its age."""


@dataclass(frozen=True, slots=True)
class Command:
    """linear_mps, angular_radps: the present command. text: why it is rest although another was received. blocked: the
    command must be at rest before it counts again.
    """

    linear_mps: float
    angular_radps: float
    text: str = ""
    blocked: bool = False


class TwistCommand:
    """Belongs to one thread. Times are steady seconds.

    discovered_s: until then a sender may exist that has not been discovered yet, so that a missing command does not
    count as silence.
    """

    def __init__(self, timeout_s: float, discovered_s: float = -math.inf) -> None:
        self._timeout_s = timeout_s
        self._discovered_s = discovered_s
        self._linear_mps = 0.0
        self._angular_radps = 0.0
        self._received_s = -math.inf
        self._demanded_s = -math.inf
        self._rested = False

    def receive(self, fields: Mapping[str, float], now_s: float, age_s: float = 0.0) -> None:
        """Stores a twist by the names of its six fields; age_s: its age by its own stamp. An invalid one counts as a
        stop and raises BadTwist; an old one changes nothing and raises OldTwist.
        """
        if age_s > self._timeout_s:
            raise OldTwist(f"it is {age_s:.3f} s old, at most {self._timeout_s} s")
        bad = [f"{name} is {value}" for name, value in fields.items() if not math.isfinite(value)]
        self._received_s = now_s - max(0.0, age_s)
        if bad:
            self._linear_mps = self._angular_radps = 0.0
            raise BadTwist(f"{', '.join(bad)}, must be finite")
        self._linear_mps, self._angular_radps = fields["linear.x"], fields["angular.z"]

    def fresh(self, now_s: float) -> bool:
        """True if the newest twist is within its timeout."""
        return 0.0 <= now_s - self._received_s <= self._timeout_s

    def demand_rest(self, now_s: float) -> None:
        """Ignores commands until the command has been at rest."""
        self._rested, self._demanded_s = False, now_s

    def requested(self, now_s: float) -> Command:
        """The command at ``now_s``."""
        if not self.fresh(now_s):
            known = self._received_s > -math.inf or now_s >= self._discovered_s
            self._rested = self._rested or (known and now_s - self._demanded_s > self._timeout_s)
            moving = self._linear_mps != 0.0 or self._angular_radps != 0.0
            return Command(0.0, 0.0, f"no command for {self._timeout_s} s" if moving else "")
        if self._linear_mps == 0.0 and self._angular_radps == 0.0:
            self._rested = True
        if not self._rested:
            return Command(0.0, 0.0, "waiting for a zero command or a command timeout", blocked=True)
        return Command(self._linear_mps, self._angular_radps)
