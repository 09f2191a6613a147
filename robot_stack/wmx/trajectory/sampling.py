"""A curve as points for the engine's spline, which accepts only positions at times.

That spline, at rest at both ends, deviates from a smooth curve by the order of the points' distance to the fourth, or
squared where accelerations jump, as between cubics. Points are inserted where the deviation is too large.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PPoly

from robot_stack.wmx.trajectory.params import SplineParams
from robot_stack.wmx.trajectory.results import GoalCode, GoalRefused
from robot_stack.wmx.trajectory.spline import ClampedSpline
from robot_stack.wmx.trajectory.waypoints import Waypoints, curve_of

FloatArray = NDArray[np.float64]
Acceptable = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]

_FIRST_STEP_S, _FIRST_STEPS = 0.04, 8  # between two points of the goal: least step and largest number initially
_LAST_STEP_S = 1e-3  # the engine's cycle: the drives' time resolution
_LOOKS = np.array([0.0, 0.25, 0.5, 0.75])  # places between two points at which the deviation is checked


def sample(points: Waypoints, acceptable: Acceptable, near: SplineParams) -> tuple[FloatArray, FloatArray]:
    """Rows (n, joints) rad and times (n,) s whose engine spline matches the curve of ``points``. acceptable: drops
    points that the engine would drop. Raises GoalRefused.
    """
    curve, times = curve_of(points), _first_times(points.times_s)
    while True:
        if len(times) > near.max_points:
            raise _too_many(near)
        rows, kept = acceptable(curve(times), times)
        if len(kept) < 2:
            return rows, kept
        h = np.diff(times)
        rough = _rough(ClampedSpline(kept, rows), curve, times, near) & (h >= 2.0 * _LAST_STEP_S)
        if not rough.any():
            return rows, kept
        times = np.sort(np.concatenate([times, times[:-1][rough] + 0.5 * h[rough]]))


def _rough(spline: ClampedSpline, curve: PPoly, times: FloatArray, near: SplineParams) -> NDArray[np.bool_]:
    """The intervals in which the spline is too far from the curve, (len(times) - 1,)."""
    between = (times[:-1, None] + np.diff(times)[:, None] * _LOOKS).ravel()
    between = between.clip(max=spline.times_s[-1])
    off_rad = np.abs(spline.positions_at(between) - curve(between)).max(axis=1)
    off_radps = np.abs(spline.velocities_at(between) - curve(between, 1)).max(axis=1)
    rough = (off_rad > near.max_deviation_rad) | (off_radps > near.max_deviation_radps)
    intervals: NDArray[np.bool_] = rough.reshape(-1, len(_LOOKS)).any(axis=1)
    return intervals


def _first_times(times: FloatArray) -> FloatArray:
    """The times, and equal steps between two of them."""
    counts = np.ceil(np.diff(times) / _FIRST_STEP_S - 1e-9).clip(1, _FIRST_STEPS).astype(np.int64)
    starts = np.repeat(times[:-1], counts)
    steps = np.repeat(np.diff(times) / counts, counts)
    within = np.arange(counts.sum()) - np.repeat(np.concatenate([[0], np.cumsum(counts)[:-1]]), counts)
    return np.append(starts + within * steps, times[-1])


def _too_many(near: SplineParams) -> GoalRefused:
    return GoalRefused(
        GoalCode.INVALID_GOAL,
        f"points.velocities: the engine's spline would need more than {near.max_points} points to follow them within "
        f"{near.max_deviation_rad:g} rad and {near.max_deviation_radps:g} rad/s",
    )
