"""Trapezoidal motion profiles: planned in closed form when a command arrives, evaluated once per cycle.

A plan is a (MAX_SEGMENTS, 4) float64 array of segments of constant acceleration, each (end time, position, velocity,
acceleration), position and velocity at the segment's start. Times count from the moment of planning; the last segment
of an endless motion ends at infinity. Because every segment is evaluated from its own start and never integrated, a
plan arrives exactly and does not drift.

Units: user units and seconds. All functions are compiled and pure.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled

MAX_SEGMENTS: Final = 4
"""Braking away from the target, then accelerating, cruising and braking towards it."""

Plan = NDArray[np.float64]

OVERTRAVEL_DISABLED: Final = 0
OVERTRAVEL_CHANGE_DECELERATION: Final = 1
OVERTRAVEL_CHANGE_INITIAL_VELOCITY: Final = 2

# Rounding in user units: a target within this distance is reached.
_NO_DISTANCE: Final = 1e-12


@compiled
def _push(plan: Plan, n: int, duration: float, position: float, velocity: float, acceleration: float) -> int:
    """Appends a segment unless its duration is below rounding. Returns the new number of segments."""
    start = plan[n - 1, 0] if n > 0 else 0.0
    end = start + duration
    if not end > start:
        return n
    plan[n, 0] = end
    plan[n, 1] = position
    plan[n, 2] = velocity
    plan[n, 3] = acceleration
    return n + 1


@compiled
def _change(
    plan: Plan, n: int, position: float, velocity: float, wanted: float, rate: float
) -> tuple[int, float, float]:
    """Changes to the ``wanted`` velocity at ``rate`` (0: at once). Returns segments, position and velocity after it."""
    if rate <= 0.0 or velocity == wanted:
        return n, position, wanted
    duration = abs(wanted - velocity) / rate
    n = _push(plan, n, duration, position, velocity, math.copysign(rate, wanted - velocity))
    return n, position + 0.5 * (velocity + wanted) * duration, wanted


@compiled
def plan_velocity(plan: Plan, position: float, velocity: float, wanted: float, acc: float, dec: float) -> int:
    """From ``velocity`` to ``wanted``, without an end. Speed grows at ``acc`` and falls at ``dec``; a ``dec`` of 0 is a
    step, and an ``acc`` of 0 is a step in either direction.

    Through zero it first falls at ``dec``, then grows at ``acc``. Returns the number of segments.
    """
    n = 0
    if acc <= 0.0:
        return _push(plan, n, math.inf, position, wanted, 0.0)
    if velocity * wanted < 0.0:
        n, position, velocity = _change(plan, n, position, velocity, 0.0, dec)
    rate = acc if abs(wanted) > abs(velocity) else dec
    n, position, velocity = _change(plan, n, position, velocity, wanted, rate)
    return _push(plan, n, math.inf, position, velocity, 0.0)


@compiled
def plan_stop(plan: Plan, position: float, velocity: float, dec: float) -> int:
    """From ``velocity`` to rest at ``dec`` (0: at once). Returns the number of segments, 0 at rest."""
    n, _, _ = _change(plan, 0, position, velocity, 0.0, dec)
    return n


@compiled
def _approach(
    plan: Plan,
    n: int,
    position: float,
    speed: float,
    distance: float,
    sign: float,
    limit: float,
    acc: float,
    dec: float,
) -> int:
    """Trapezoid over ``distance`` in the direction ``sign``, which must suffice to stop from ``speed`` at ``dec``."""
    if speed > limit:
        peak = limit
        ramp = (speed * speed - limit * limit) / (2.0 * dec)
        n, position, _ = _change(plan, n, position, sign * speed, sign * peak, dec)
    else:
        reachable = math.sqrt((2.0 * acc * dec * distance + dec * speed * speed) / (acc + dec))
        peak = min(limit, max(reachable, speed))
        ramp = (peak * peak - speed * speed) / (2.0 * acc)
        n, position, _ = _change(plan, n, position, sign * speed, sign * peak, acc)
    cruise = distance - ramp - peak * peak / (2.0 * dec)
    if peak > 0.0 and cruise > 0.0:
        n = _push(plan, n, cruise / peak, position, sign * peak, 0.0)
        position += sign * cruise
    n, _, _ = _change(plan, n, position, sign * peak, 0.0, dec)
    return n


@compiled
def plan_position(
    plan: Plan,
    position: float,
    velocity: float,
    target: float,
    limit: float,
    acc: float,
    dec: float,
    overtravel: int,
) -> int:
    """From a position and velocity to rest at ``target``; ``limit``, ``acc`` and ``dec`` are positive.

    Above the limit it brakes to it first; moving away from the target it brakes to rest and returns. If it cannot
    stop in time at ``dec``, ``overtravel`` decides: overshoot and return, brake harder to stop exactly there,
    or step the velocity down to one from which it can stop. Returns the number of segments.
    """
    distance = abs(target - position)
    sign = 1.0 if target >= position else -1.0
    speed = velocity * sign
    # The margin is rounding: a plan renewed in the middle of its own braking must not count as too late.
    too_late = speed > 0.0 and velocity * velocity / (2.0 * dec) > distance * (1.0 + 1e-9) + _NO_DISTANCE
    n = 0
    if too_late and overtravel == OVERTRAVEL_CHANGE_DECELERATION:
        if distance <= _NO_DISTANCE:
            return 0  # no deceleration stops there: over a distance near zero it would not be finite
        return _push(plan, n, 2.0 * distance / speed, position, velocity, -velocity * speed / (2.0 * distance))
    if too_late and overtravel == OVERTRAVEL_CHANGE_INITIAL_VELOCITY:
        return _approach(plan, n, position, math.sqrt(2.0 * dec * distance), distance, sign, limit, acc, dec)
    if too_late or speed < 0.0:
        n, position, _ = _change(plan, n, position, velocity, 0.0, dec)
        distance = abs(target - position)
        sign = 1.0 if target >= position else -1.0
        speed = 0.0
    return _approach(plan, n, position, speed, distance, sign, limit, acc, dec)


@compiled
def evaluate(plan: Plan, n: int, t: float) -> tuple[float, float, float, bool]:
    """(position, velocity, acceleration, ended) at time ``t`` of a plan of ``n`` segments.

    An ended plan gives the end of its last segment at rest; without any segment the position is NaN and the
    caller keeps its own.
    """
    start = 0.0
    for k in range(n):
        end = plan[k, 0]
        if t < end:
            dt = t - start
            velocity = plan[k, 2] + plan[k, 3] * dt
            return plan[k, 1] + (plan[k, 2] + 0.5 * plan[k, 3] * dt) * dt, velocity, plan[k, 3], False
        start = end
    if n == 0:
        return math.nan, 0.0, 0.0, True
    begin = plan[n - 2, 0] if n > 1 else 0.0
    dt = plan[n - 1, 0] - begin
    return plan[n - 1, 1] + (plan[n - 1, 2] + 0.5 * plan[n - 1, 3] * dt) * dt, 0.0, 0.0, True


@compiled
def remaining(plan: Plan, n: int, t: float) -> float:
    """Seconds until the plan ends at time ``t``; infinite for an endless one, 0 for an ended one."""
    return max(plan[n - 1, 0] - t, 0.0) if n > 0 else 0.0
