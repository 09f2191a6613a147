"""Converts checked waypoints to the engine's input: rows and times, from the present position at time 0."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.trajectory.params import SplineParams
from robot_stack.wmx.trajectory.results import GoalCode, GoalRefused
from robot_stack.wmx.trajectory.sampling import sample
from robot_stack.wmx.trajectory.spline import ClampedSpline
from robot_stack.wmx.trajectory.waypoints import (
    STANDS_RADPS,
    Waypoints,
    curve_of,
    knot_velocities,
    peak_accelerations,
    segments,
)

FloatArray = NDArray[np.float64]

_SHORTEST_LAST_S = 1e-3  # documented: a last point less than 1 ms after the one before is ignored
_SHORTEST_GAP_S = 2e-6  # the engine refuses 1e-3 ms; twice that exceeds any rounding
# The engine drops the later of two points closer than 1e-6, with its time.
_SAME_RAD = 1e-6
# A point that repeats the previous one is a pause: shifted by this it is kept, and so is the time at which the motion
# continues. Only for long pauses, where the shift causes no acceleration (6 * 2e-6 / 0.1^2 = 0.001 rad/s^2).
_SHIFT_RAD = 2e-6
_SHORTEST_PAUSE_S = 0.1
_SAMPLED_PAUSE_S = 0.004  # the same between sampled points of a curve, where the ends of a pause matter more


@dataclass(frozen=True, slots=True)
class PlanLimits:
    """same_position_rad: a first point this near is the present position. max_start_deviation_rad: largest distance of
    a first point at time 0 from the present position; 0 means no limit. max_velocity_radps, max_acceleration_radps2:
    per axis; empty, or 0 for an axis: no limit. catch_up_ratio, catch_up_acceleration_radps2: acceleration of an axis
    for a late start, as a multiple of the trajectory's greatest one or as a value, whichever is more. near: tolerance
    of the engine's spline against a curve with velocities. speed_scaling: of the trajectory's time. continuous: axes
    that turn without an end.
    """

    same_position_rad: float
    max_start_deviation_rad: float
    max_velocity_radps: tuple[float, ...]
    max_acceleration_radps2: tuple[float, ...]
    catch_up_ratio: float
    catch_up_acceleration_radps2: float
    near: SplineParams
    speed_scaling: float
    continuous: tuple[int, ...]


def plan_spline(
    points: Waypoints, late_s: float, present: FloatArray, joints: tuple[str, ...], limits: PlanLimits
) -> ClampedSpline | None:
    """The spline from the present position (joints,), at standstill, along the curve of the waypoints; None if
    there is no distance to travel. late_s: time since time 0.

    The first time is 0: forced if the first point is the present position, which otherwise is put before it. A late
    start leaves out the points that have passed, and those that it cannot reach in time.
    Raises GoalRefused.
    """
    goal = points.positions[-1]
    points = points.unwrapped(present, limits.continuous)
    last = points.positions[-1]
    if late_s == 0.0:
        _check_start(points, present, joints, limits.max_start_deviation_rad)
    several = len(points) > 1
    points = _with_start(points, present, limits.same_position_rad)
    if several and points.times_s[-1] - points.times_s[-2] < _SHORTEST_LAST_S:
        points = _without_last(points)
    if late_s > 0.0 and len(points) > 1:
        points = _caught_up(points, late_s, limits)
    kept_rows, kept_times = _engine_points(points.slowed(limits.speed_scaling), limits)
    if len(kept_rows) < 2:
        if np.abs(last - present).max() <= limits.same_position_rad:
            return None
        raise GoalRefused(GoalCode.INVALID_GOAL, f"no time to get from the present position to {_place(goal)}")
    spline = ClampedSpline(kept_times, kept_rows)
    _check_peak("velocity", "rad/s", spline.max_speed(), limits.max_velocity_radps, joints)
    _check_peak("acceleration", "rad/s^2", spline.max_acceleration(), limits.max_acceleration_radps2, joints)
    return spline


def _check_start(points: Waypoints, present: FloatArray, joints: tuple[str, ...], limit_rad: float) -> None:
    """Checks a first point at time 0, which leaves no time to reach its position and velocity."""
    if points.times_s[0] != 0.0:
        return
    deviation = np.abs(points.positions[0] - present)
    axis = int(np.argmax(deviation))
    if limit_rad > 0.0 and deviation[axis] > limit_rad:
        raise GoalRefused(
            GoalCode.INVALID_GOAL,
            f"points[0]: {joints[axis]} is {deviation[axis]:.4f} rad away from the present position at time 0, "
            f"at most {limit_rad:g} rad",
        )
    if points.velocities is not None and np.abs(points.velocities[0]).max() > STANDS_RADPS:
        axis = int(np.argmax(np.abs(points.velocities[0])))
        raise GoalRefused(
            GoalCode.INVALID_GOAL,
            f"points[0].velocities: {joints[axis]} at {points.velocities[0, axis]:g} rad/s at time 0, at standstill",
        )


def _with_start(points: Waypoints, present: FloatArray, same_rad: float) -> Waypoints:
    """Replaces the first point by the present position at time 0, or prepends it.

    A first point at time 0 leaves no time to reach it: the engine starts at the present position and skips that point.
    """
    near = np.abs(points.positions[0] - present).max() <= same_rad
    rests = points.velocities is None or np.abs(points.velocities[0]).max() <= STANDS_RADPS
    if points.times_s[0] != 0.0 and not (near and rests):
        return points.after_rest(present)
    started = points.rows(slice(1, None)).after_rest(present)
    if points.accelerations is not None and started.accelerations is not None:
        started.accelerations[0] = points.accelerations[0]
    return started


def _without_last(points: Waypoints) -> Waypoints:
    """The points without the last one, with rest at the end."""
    shorter = points.rows(slice(None, -1))
    velocities = None if shorter.velocities is None else shorter.velocities.copy()
    if velocities is not None:
        velocities[-1] = 0.0
    return replace(shorter, velocities=velocities)


def _caught_up(points: Waypoints, late_s: float, limits: PlanLimits) -> Waypoints:
    """The points from the present position to the first one that can be reached in time, and onwards."""
    ahead = points.rows(slice(int(np.searchsorted(points.times_s, late_s + _SHORTEST_LAST_S)), None))
    velocities = knot_velocities(points)[len(points) - len(ahead) :]
    present = points.positions[0]
    if not np.abs(points.positions - present).max():
        return points  # at rest in any case
    own, curve = np.diff(points.times_s), curve_of(points)
    allowed = np.maximum(
        limits.catch_up_ratio * peak_accelerations(own, curve.c).max(axis=0), limits.catch_up_acceleration_radps2
    )
    still = np.zeros_like(ahead.positions)
    h = ahead.times_s - late_s
    ends = (present + still, ahead.positions, still, velocities)
    accelerations = (None, None) if ahead.accelerations is None else (still, ahead.accelerations)
    reachable = (peak_accelerations(h, segments(h, *ends, *accelerations)) <= allowed).all(axis=1)
    if not reachable.any():
        raise GoalRefused(
            GoalCode.INVALID_GOAL,
            f"trajectory.header.stamp: {late_s:.3f} s ago, it is too late to catch up with the trajectory",
        )
    first = int(np.argmax(reachable))
    rest = replace(ahead, velocities=velocities, times_s=h).rows(slice(first, None))
    return rest.after_rest(present)


def _engine_points(points: Waypoints, limits: PlanLimits) -> tuple[FloatArray, FloatArray]:
    """Positions alone use the engine's spline, as documented; other curves are sent as more points."""
    if points.velocities is None or len(points) < 2:
        return _acceptable(points.positions, points.times_s)
    within = partial(_acceptable, shortest_pause_s=_SAMPLED_PAUSE_S)
    return sample(points, within, limits.near)


def _acceptable(
    rows: FloatArray, times: FloatArray, shortest_pause_s: float = _SHORTEST_PAUSE_S
) -> tuple[FloatArray, FloatArray]:
    """Drops the points that the engine would refuse or drop; pauses in between are kept."""
    anchor = rows[0]  # the position that repeated points hold
    kept_rows, kept_times, stands = [anchor], [float(times[0])], [False]
    for row, time_s in zip(rows[1:], times[1:].tolist(), strict=True):
        gap_s = time_s - kept_times[-1]
        repeats = _same(row, anchor)
        if gap_s < _SHORTEST_GAP_S or (gap_s < shortest_pause_s and (repeats or _same(row, kept_rows[-1]))):
            continue
        anchor = anchor if repeats else row
        kept_rows.append(_apart(anchor, kept_rows[-1]))
        kept_times.append(time_s)
        stands.append(repeats)
    while stands[-1]:  # the engine stands at the end in any case
        for kept in (kept_rows, kept_times, stands):
            kept.pop()
    return np.array(kept_rows), np.array(kept_times)


def _same(row: FloatArray, other: FloatArray) -> bool:
    return bool(np.abs(row - other).max() <= _SAME_RAD)


def _apart(row: FloatArray, before: FloatArray) -> FloatArray:
    """The row, shifted away from the one before if the engine would drop it."""
    if not _same(row, before):
        return row
    difference = row - before
    shift_rad = float(np.copysign(_SHIFT_RAD, difference[np.abs(difference).argmax()]))
    return row + shift_rad


def _check_peak(what: str, unit: str, peaks: FloatArray, limits: tuple[float, ...], joints: tuple[str, ...]) -> None:
    for joint, peak, limit in zip(joints, peaks.tolist(), limits, strict=False):
        if limit > 0.0 and peak > limit:
            raise GoalRefused(
                GoalCode.INVALID_GOAL, f"{joint}: {what} {peak:.3f} {unit} along the path, at most {limit:g} {unit}"
            )


def _place(position: FloatArray) -> str:
    return "(" + ", ".join(f"{value:.4f}" for value in position.tolist()) + ")"
