"""What the base is asked to do: the newest twist, as long as it is young.

Whenever the drive becomes able to move (at the start, after a fault, after an emergency stop) it must first see the
command at rest, zero or silent. A sender that never noticed the stop would else set the base in motion by itself.
Silence counts from when rest is demanded: a node that was held up has heard nothing, which says nothing of the sender.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass


class BadTwist(Exception):
    """A twist that cannot be obeyed. The message names field and value."""


class OldTwist(Exception):
    """A twist that was too old when it came. The message names its age."""


@dataclass(frozen=True, slots=True)
class Command:
    """linear_mps, angular_radps: what to drive now. text: why it is rest although something else was commanded.
    blocked: the command must be at rest before it is obeyed again.
    """

    linear_mps: float
    angular_radps: float
    text: str = ""
    blocked: bool = False


class TwistCommand:
    """Belongs to one thread. Times are steady seconds.

    heard_from_s: until then a sender may be there that has not been discovered yet, and that nothing was ever received
    is no silence.
    """

    def __init__(self, timeout_s: float, heard_from_s: float = -math.inf) -> None:
        self._timeout_s = timeout_s
        self._heard_from_s = heard_from_s
        self._linear_mps = 0.0
        self._angular_radps = 0.0
        self._received_s = -math.inf
        self._demanded_s = -math.inf
        self._rested = False

    def receive(self, fields: Mapping[str, float], now_s: float, age_s: float = 0.0) -> None:
        """Takes a twist by the names of its six fields; age_s: how old it is by its own stamp. A bad one counts as a
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
        """The newest twist is young enough."""
        return 0.0 <= now_s - self._received_s <= self._timeout_s

    def demand_rest(self, now_s: float) -> None:
        """From now on nothing is obeyed until the command has been at rest."""
        self._rested, self._demanded_s = False, now_s

    def requested(self, now_s: float) -> Command:
        """What to drive at ``now_s``."""
        if not self.fresh(now_s):
            known = self._received_s > -math.inf or now_s >= self._heard_from_s
            self._rested = self._rested or (known and now_s - self._demanded_s > self._timeout_s)
            moving = self._linear_mps != 0.0 or self._angular_radps != 0.0
            return Command(0.0, 0.0, f"no command for {self._timeout_s} s" if moving else "")
        if self._linear_mps == 0.0 and self._angular_radps == 0.0:
            self._rested = True
        if not self._rested:
            return Command(0.0, 0.0, "waiting for the command to be zero or silent once", blocked=True)
        return Command(self._linear_mps, self._angular_radps)
