"""From checked waypoints to what the engine is given: rows and times that start at the present position at time 0."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.trajectory.results import GoalCode, GoalRefused
from robot_stack.wmx.trajectory.spline import ClampedSpline

FloatArray = NDArray[np.float64]

_SHORTEST_LAST_S = 1e-3  # documented: a last point less than 1 ms after the one before is ignored
_SHORTEST_GAP_S = 2e-6  # the engine refuses 1e-3 ms; twice that is beyond any rounding
# Of two points closer than 1e-6 the engine drops the later, and its time with it.
_SAME_RAD = 1e-6
# A point that repeats the one before is a pause: moved by this it stays, and with it the time at which the motion goes
# on. Only with so much time between them, where the shift means no acceleration (6 * 2e-6 / 0.1^2 = 0.001 rad/s^2).
_SHIFT_RAD = 2e-6
_SHORTEST_PAUSE_S = 0.1


@dataclass(frozen=True, slots=True)
class PlanLimits:
    """same_position_rad: a first point so near is the present position. max_start_deviation_rad: how far the first
    point may be from the present position; 0 means no limit. max_velocity_radps, max_acceleration_radps2: per axis;
    empty, or 0 for an axis: no limit.
    """

    same_position_rad: float
    max_start_deviation_rad: float
    max_velocity_radps: tuple[float, ...]
    max_acceleration_radps2: tuple[float, ...]


def plan_spline(
    positions: FloatArray, times_s: FloatArray, present: FloatArray, joints: tuple[str, ...], limits: PlanLimits
) -> ClampedSpline | None:
    """The spline from the present position (joints,) through the waypoints; None if there is no way to go.

    The first time is 0: forced if the first point is the present position, which otherwise is put before it.
    Raises GoalRefused.
    """
    _check_start(positions[0], present, joints, limits.max_start_deviation_rad)
    rows, times = _with_start(positions, times_s, present, limits.same_position_rad)
    if len(positions) > 1 and times[-1] - times[-2] < _SHORTEST_LAST_S:
        rows, times = rows[:-1], times[:-1]
    kept_rows, kept_times = _acceptable(rows, times)
    if len(kept_rows) < 2:
        if np.abs(positions[-1] - present).max() <= limits.same_position_rad:
            return None
        raise GoalRefused(GoalCode.INVALID_GOAL, f"no time to get from the present position to {_place(positions[-1])}")
    spline = ClampedSpline(kept_times, kept_rows)
    _check_peak("velocity", "rad/s", spline.max_speed(), limits.max_velocity_radps, joints)
    _check_peak("acceleration", "rad/s^2", spline.max_acceleration(), limits.max_acceleration_radps2, joints)
    return spline


def _check_start(first: FloatArray, present: FloatArray, joints: tuple[str, ...], limit_rad: float) -> None:
    deviation = np.abs(first - present)
    axis = int(np.argmax(deviation))
    if limit_rad > 0.0 and deviation[axis] > limit_rad:
        raise GoalRefused(
            GoalCode.INVALID_GOAL,
            f"points[0]: {joints[axis]} is {deviation[axis]:.4f} rad away from the present position, "
            f"at most {limit_rad:g} rad",
        )


def _with_start(
    positions: FloatArray, times_s: FloatArray, present: FloatArray, same_rad: float
) -> tuple[FloatArray, FloatArray]:
    """The present position at time 0 in the place of the first point, or before it.

    A first point at time 0 leaves no time to get to it: the engine starts where it is and passes over that point.
    """
    starts_here = times_s[0] == 0.0 or np.abs(positions[0] - present).max() <= same_rad
    rest = 1 if starts_here else 0
    return np.vstack([present, positions[rest:]]), np.concatenate([[0.0], times_s[rest:]])


def _acceptable(rows: FloatArray, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Without the points that the engine would refuse or drop; pauses in between are kept."""
    anchor = rows[0]  # the place where the motion stands while points repeat it
    kept_rows, kept_times, stands = [anchor], [float(times[0])], [False]
    for row, time_s in zip(rows[1:], times[1:].tolist(), strict=True):
        gap_s = time_s - kept_times[-1]
        repeats = bool(np.abs(row - anchor).max() <= _SAME_RAD)
        if gap_s < _SHORTEST_GAP_S or (repeats and gap_s < _SHORTEST_PAUSE_S):
            continue
        if not repeats and np.abs(row - kept_rows[-1]).max() <= _SAME_RAD:
            continue
        anchor = anchor if repeats else row
        kept_rows.append(anchor + _SHIFT_RAD if repeats and kept_rows[-1] is anchor else anchor)
        kept_times.append(time_s)
        stands.append(repeats)
    while stands[-1]:  # standing at the end is what the engine does anyway
        for kept in (kept_rows, kept_times, stands):
            kept.pop()
    return np.array(kept_rows), np.array(kept_times)


def _check_peak(what: str, unit: str, peaks: FloatArray, limits: tuple[float, ...], joints: tuple[str, ...]) -> None:
    for joint, peak, limit in zip(joints, peaks.tolist(), limits, strict=False):
        if limit > 0.0 and peak > limit:
            raise GoalRefused(
                GoalCode.INVALID_GOAL, f"{joint}: {what} {peak:.3f} {unit} on the way, at most {limit:g} {unit}"
            )


def _place(position: FloatArray) -> str:
    return "(" + ", ".join(f"{value:.4f}" for value in position.tolist()) + ")"
