"""Time spans whose failures lead to a stop.

All times are seconds of one steady clock, given as arguments. Time that runs backwards (a restarted simulation) or is
not a number makes every age infinite and restarts every hold: it can raise a fault, never hide one.
"""

from __future__ import annotations

import math


def age_s(now_s: float, then_s: float | None) -> float:
    """Seconds since ``then_s``; infinite if it is None or in the future, or either time is NaN."""
    if then_s is None:
        return math.inf
    age = now_s - then_s
    return age if age >= 0.0 else math.inf


class Hold:
    """For how long a condition has been true without a break."""

    __slots__ = ("_since_s",)

    def __init__(self) -> None:
        self._since_s: float | None = None

    def update(self, condition: bool, now_s: float) -> float | None:
        """Seconds the condition has held, 0.0 on the first call that finds it true; None while it is false."""
        if not condition:
            self._since_s = None
            return None
        if self._since_s is None or not now_s >= self._since_s:
            self._since_s = now_s
        return now_s - self._since_s
