"""What the base is asked to do: the newest twist, as long as it is young.

Whenever the drive becomes able to move (at the start, after a fault, after an emergency stop) it must first see the
command at rest, zero or silent. A sender that never noticed the stop would else set the base in motion by itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass


class BadTwist(Exception):
    """A twist that cannot be obeyed. The message names field and value."""


@dataclass(frozen=True, slots=True)
class Wish:
    """linear_mps, angular_radps: what to drive now. text: why it is rest although something else was commanded.
    blocked: the command must be at rest before it is obeyed again.
    """

    linear_mps: float
    angular_radps: float
    text: str = ""
    blocked: bool = False


class TwistCommand:
    """Belongs to one thread. Times are steady seconds."""

    def __init__(self, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        self._linear_mps = 0.0
        self._angular_radps = 0.0
        self._received_s = -math.inf
        self._rested = False

    def receive(self, fields: Mapping[str, float], now_s: float) -> None:
        """Takes a twist by the names of its six fields. A bad one counts as a stop and raises BadTwist."""
        bad = [f"{name} is {value}" for name, value in fields.items() if not math.isfinite(value)]
        self._received_s = now_s
        if bad:
            self._linear_mps = self._angular_radps = 0.0
            raise BadTwist(f"{', '.join(bad)}, must be finite")
        self._linear_mps, self._angular_radps = fields["linear.x"], fields["angular.z"]

    def fresh(self, now_s: float) -> bool:
        """The newest twist is young enough."""
        return 0.0 <= now_s - self._received_s <= self._timeout_s

    def demand_rest(self) -> None:
        """From now on nothing is obeyed until the command has been at rest."""
        self._rested = False

    def wish(self, now_s: float) -> Wish:
        """What to drive at ``now_s``."""
        if not self.fresh(now_s):
            self._rested = True
            moving = self._linear_mps != 0.0 or self._angular_radps != 0.0
            return Wish(0.0, 0.0, f"no command for {self._timeout_s} s" if moving else "")
        if self._linear_mps == 0.0 and self._angular_radps == 0.0:
            self._rested = True
        if not self._rested:
            return Wish(0.0, 0.0, "waiting for the command to be zero or silent once", blocked=True)
        return Wish(self._linear_mps, self._angular_radps)
