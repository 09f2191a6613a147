"""Braking in discrete steps: the largest rate from which a stop within a distance is possible."""

from __future__ import annotations

import math


def stoppable_rate(distance: float, change_per_s: float, dt_s: float) -> float:
    """The largest rate for the next step from which the rate can fall to 0 without going beyond ``distance``.

    The rate is constant within a step of ``dt_s`` and may fall by g = change_per_s * dt_s from one step to the next. A
    step at the rate r = n g + f (0 <= f < g), followed by the falling ones, covers dt ((n + 1) r - g n (n + 1) / 2);
    solved for r. All arguments positive, ``distance`` may be 0. The unit of the rate is that of the distance per
    second.
    """
    fall = change_per_s * dt_s
    steps = math.floor(0.5 * (math.sqrt(1.0 + 8.0 * distance / (fall * dt_s)) - 1.0))
    return (distance / dt_s + 0.5 * fall * steps * (steps + 1)) / (steps + 1)
