"""Cubic splines through points at given times: planned when the command arrives, evaluated once per cycle, compiled.

A spline of ``n`` points and ``d`` dimensions:

    times   (n,)          float64   path time of each point, s, ascending from 0
    points  (n, d)        float64   positions, user units
    curve   (n - 1, d, 4) float64   c0 + c1 u + c2 u^2 + c3 u^3 from each point to the next, u = path time since it
    axes    (d,)          int64     axis of each dimension
    goal    (d,)          float64   the last point
    bounds  (d,)          float64   deceleration that a stop may ask of each axis, user units / s^2
    clock   (N_CLOCK,)    float64   path time, rate, fall
    count   (N_COUNT,)    int64     cycles, segment, stopping

It is clamped: at rest at both ends, with position, velocity and acceleration continuous between them (the tridiagonal
system of velocities of de Boor, A Practical Guide to Splines, chapter IV).

A stop does not leave the path: path time s runs on at a rate r that falls from 1 to 0. With the curve f,

    velocity = f'(s) r,   acceleration = f''(s) r^2 - f'(s) fall,   fall = -dr/dt

and in each cycle ``fall`` is the largest that keeps every axis within its bound D. Where the path itself brakes, that
may be zero, so it is never less than half of what D alone would allow, min(D / |f'|) / 2. Hence

    the stop takes no longer than 2 max(|f'| / D), over the axes and the rest of the path, and
    no axis exceeds max(D, |f''| r^2 + D / 2): its bound, wherever the path itself asks for less than half of it.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from robot_stack.core.compiled import compiled
from robot_stack.wmx.engine_server import rows
from robot_stack.wmx.engine_server.kernel import (
    CMD_ACC,
    DETAIL,
    DETAIL_IDLE,
    DISTRIBUTED,
    IDLE,
    MOTION_COMPLETE,
    OP_STATE,
    POS_CMD,
    REMAINING_MS,
    TARGET,
    VELOCITY_CMD,
)
from robot_stack.wmx.engine_server.state import EngineArrays, Ints, Reals

(PATH_TIME, RATE, FALL) = range(3)  # FALL: of a timed stop, 0 = by the bounds
N_CLOCK: Final = 3
(CYCLES, SEGMENT, STOPPING) = range(3)
N_COUNT: Final = 3

SAME_POINT: Final = 1e-6
"""Of two points closer than this in every dimension the later is dropped, user units."""
_ROUNDING_S: Final = 1e-9
_PASSES: Final = 2
"""A stop looks at curve and rate in the middle of the cycle, which depends on how far the rate falls in it."""


@compiled
def drop_repeated(times: Reals, points: Reals) -> int:
    """Moves the points that differ from the previously kept one to the front. Returns their number."""
    kept = 1
    for k in range(1, times.size):
        differs = False
        for j in range(points.shape[1]):
            if not abs(points[k, j] - points[kept - 1, j]) < SAME_POINT:
                differs = True
        if differs:
            times[kept] = times[k]
            points[kept] = points[k]
            kept += 1
    return kept


@compiled
def plan_spline(times: Reals, points: Reals, curve: Reals) -> float:
    """Fills ``curve``. Returns a bound on the distance of the whole path from 0, user units (its convex hull)."""
    n, d = points.shape
    upper = np.zeros(n)
    velocity = np.zeros(n)
    farthest = 0.0
    for j in range(d):
        for k in range(1, n - 1):
            before, after = times[k] - times[k - 1], times[k + 1] - times[k]
            rise_before, rise_after = points[k, j] - points[k - 1, j], points[k + 1, j] - points[k, j]
            weighted = before * rise_after / after + after * rise_before / before
            pivot = 2.0 * (before + after) - after * upper[k - 1]
            upper[k] = before / pivot
            velocity[k] = (3.0 * weighted - after * velocity[k - 1]) / pivot
        velocity[n - 1] = 0.0
        for k in range(n - 2, 0, -1):
            velocity[k] -= upper[k] * velocity[k + 1]
        for k in range(n - 1):
            h = times[k + 1] - times[k]
            slope = (points[k + 1, j] - points[k, j]) / h
            curve[k, j, 0] = points[k, j]
            curve[k, j, 1] = velocity[k]
            curve[k, j, 2] = (3.0 * slope - 2.0 * velocity[k] - velocity[k + 1]) / h
            curve[k, j, 3] = (velocity[k] + velocity[k + 1] - 2.0 * slope) / (h * h)
            leaving = abs(points[k, j] + velocity[k] * h / 3.0)
            arriving = abs(points[k + 1, j] - velocity[k + 1] * h / 3.0)
            farthest = max(farthest, abs(points[k, j]), leaving, arriving, abs(points[k + 1, j]))
    return farthest


@compiled
def _segment(times: Reals, segment: int, s: float) -> int:
    """The segment that holds path time ``s``, at or after a given one."""
    while segment < times.size - 2 and s >= times[segment + 1]:
        segment += 1
    return segment


@compiled
def at(curve: Reals, segment: int, j: int, u: float) -> tuple[float, float, float]:
    """Position and its first two derivatives of dimension ``j``, ``u`` seconds into a segment."""
    c0, c1, c2, c3 = curve[segment, j, 0], curve[segment, j, 1], curve[segment, j, 2], curve[segment, j, 3]
    return c0 + (c1 + (c2 + c3 * u) * u) * u, c1 + (2.0 * c2 + 3.0 * c3 * u) * u, 2.0 * c2 + 6.0 * c3 * u


@compiled
def _fall(work: Ints, curve: Reals, axes: Ints, bounds: Reals, mark: int, segment: int, u: float, rate: float) -> float:
    """Largest fall of the rate here, 1/s; infinite where no axis moves. See the module."""
    least, best = math.inf, math.inf
    for j in range(axes.size):
        _, slope, bend = at(curve, segment, j, u)
        if work[rows.SPLINE, axes[j]] != mark or slope == 0.0:
            continue
        least = min(least, bounds[j] / abs(slope))
        own = bend * rate * rate * math.copysign(1.0, slope)
        best = min(best, (bounds[j] + own) / abs(slope))
    return max(best, 0.5 * least)


@compiled
def _rest_ahead(s: float, rate: float, fall: float, duration: float) -> tuple[float, float]:
    """Seconds until rest and its path time, if the rate keeps falling as it does; or the end of the path."""
    way = duration - s
    rest_of_square = rate * rate - 2.0 * fall * way
    if rest_of_square < 0.0:
        return rate / fall, s + 0.5 * rate * rate / fall
    return 2.0 * way / (rate + math.sqrt(rest_of_square)), duration


@compiled
def step_spline(
    arrays: EngineArrays,
    times: Reals,
    curve: Reals,
    goal: Reals,
    axes: Ints,
    bounds: Reals,
    clock: Reals,
    count: Ints,
    mark: int,
    dt: float,
) -> bool:
    """One cycle of every axis that is still on the spline ``mark``. Returns whether the spline has ended."""
    reals, flags, _, work, _ = arrays
    duration = times[times.size - 1]
    stopping = count[STOPPING] != 0
    fall, rest = 0.0, False
    remaining_s = 0.0
    stop_at = duration
    if stopping:
        s, rate = clock[PATH_TIME], clock[RATE]
        fall = clock[FALL]
        mean = rate
        for _ in range(_PASSES if fall == 0.0 else 0):
            halfway = min(s + 0.5 * mean * dt, duration)
            segment = _segment(times, count[SEGMENT], halfway)
            fall = _fall(work, curve, axes, bounds, mark, segment, halfway - times[segment], mean)
            mean = max(rate - 0.5 * fall * dt, 0.5 * rate)
        rest = rate <= fall * dt * (1.0 + 1e-9)
        after = 0.0 if rest else rate - fall * dt
        s += 0.5 * rate * rate / fall if rest else 0.5 * (rate + after) * dt
        clock[RATE] = after
        if not rest:
            remaining_s, stop_at = _rest_ahead(s, after, fall, duration)
    else:
        count[CYCLES] += 1
        s = count[CYCLES] * dt
        remaining_s = duration - s
    ended = s >= duration - _ROUNDING_S
    s = min(s, duration)
    clock[PATH_TIME] = s
    count[SEGMENT] = _segment(times, count[SEGMENT], s)
    u, rate = s - times[count[SEGMENT]], clock[RATE]
    stop_segment = _segment(times, count[SEGMENT], stop_at)
    for j in range(axes.size):
        i = axes[j]
        if work[rows.SPLINE, i] != mark:
            continue
        position, slope, bend = at(curve, count[SEGMENT], j, u)
        if not (ended or rest):
            reals[POS_CMD, i] = position
            reals[VELOCITY_CMD, i] = slope * rate
            reals[CMD_ACC, i] = bend * rate * rate - slope * fall
            reals[REMAINING_MS, i] = 1e3 * remaining_s
            if stopping:
                reals[TARGET, i], _, _ = at(curve, stop_segment, j, stop_at - times[stop_segment])
            continue
        reals[POS_CMD, i] = goal[j] if ended else position
        reals[TARGET, i] = reals[POS_CMD, i]
        reals[VELOCITY_CMD, i] = 0.0
        reals[CMD_ACC, i] = 0.0
        reals[REMAINING_MS, i] = 0.0
        flags[MOTION_COMPLETE, i] = 0 if stopping else 1
        flags[OP_STATE, i] = IDLE
        flags[DETAIL, i] = DETAIL_IDLE
        flags[DISTRIBUTED, i] = 1
        work[rows.SPLINE, i] = 0
    return ended or rest
