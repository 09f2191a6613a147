"""A goal as received, and as executed: checked as a whole, in the order of the axes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.trajectory.results import GoalCode, GoalRefused
from robot_stack.wmx.trajectory.tolerances import JointTolerance, Tolerances, resolve
from robot_stack.wmx.trajectory.waypoints import STANDS_RADPS, Waypoints

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Point:
    """One waypoint; rad, rad/s, rad/s^2, N m, s. Everything but positions and time may be empty."""

    positions: Sequence[float]
    time_s: float
    velocities: Sequence[float] = ()
    accelerations: Sequence[float] = ()
    effort: Sequence[float] = ()


@dataclass(frozen=True, slots=True)
class Goal:
    """A client's goal. stamp_s: ROS time of time 0; 0 means now. goal_time_s: 0 means the default."""

    joint_names: Sequence[str]
    points: Sequence[Point]
    stamp_s: float = 0.0
    path_tolerance: Sequence[JointTolerance] = ()
    goal_tolerance: Sequence[JointTolerance] = ()
    goal_time_s: float = 0.0
    multi_dof_joints: Sequence[str] = ()


@dataclass(frozen=True, slots=True)
class GoalLimits:
    """joints: names in the order of their axes. max_start_delay_s: a start further ahead is an error of clocks.
    path_position_rad on the path, goal_position_rad, goal_velocity_radps and goal_time_s at the end: defaults where
    the goal gives nothing; 0 means no limit, except for the time.
    """

    joints: tuple[str, ...]
    max_points: int
    max_start_delay_s: float
    path_position_rad: float
    goal_position_rad: float
    goal_velocity_radps: float
    goal_time_s: float


@dataclass(frozen=True, slots=True)
class CheckedGoal:
    """points: columns in the order of the axes; may be empty. order: the axis column of each joint in the goal's order.
    start_in_s: time until the start; late_s: time since the start.
    """

    points: Waypoints
    order: tuple[int, ...]
    start_in_s: float
    late_s: float
    path: Tolerances
    at_goal: Tolerances
    goal_time_s: float


def check_goal(goal: Goal, limits: GoalLimits, now_s: float) -> CheckedGoal:
    """The goal in the order of the axes. now_s: ROS time. Raises GoalRefused with code and reason."""
    n_points, n_joints = len(goal.points), len(limits.joints)
    if n_points > limits.max_points:
        raise GoalRefused(
            GoalCode.INVALID_GOAL, f"{n_points} points, the engine's spline takes at most {limits.max_points}"
        )
    if goal.multi_dof_joints:
        raise GoalRefused(GoalCode.INVALID_GOAL, "multi_dof_trajectory cannot be followed: every joint has one axis")
    if n_points == 0:
        none = Tolerances.none(n_joints)
        nothing = Waypoints(np.zeros(0), np.zeros((0, n_joints)))
        return CheckedGoal(nothing, tuple(range(n_joints)), 0.0, 0.0, none, none, 0.0)
    order = _order(goal.joint_names, limits.joints)
    points = _points(goal.points, order)
    _check_end(points, limits.joints)
    start_in_s = _start_in_s(goal.stamp_s, float(points.times_s[-1]), limits.max_start_delay_s, now_s)
    return CheckedGoal(
        points=points,
        order=order,
        start_in_s=max(0.0, start_in_s),
        late_s=max(0.0, -start_in_s),
        path=resolve("path_tolerance", goal.path_tolerance, limits.joints, limits.path_position_rad),
        at_goal=resolve(
            "goal_tolerance",
            goal.goal_tolerance,
            limits.joints,
            limits.goal_position_rad,
            limits.goal_velocity_radps,
        ),
        goal_time_s=_goal_time_s(goal.goal_time_s, limits.goal_time_s),
    )


def _order(names: Sequence[str], joints: tuple[str, ...]) -> tuple[int, ...]:
    unknown = [name for name in names if name not in joints]
    missing = [joint for joint in joints if joint not in names]
    twice = sorted({name for name in names if list(names).count(name) > 1})
    problems = [
        f"{what}: {', '.join(map(repr, found))}"
        for what, found in (("unknown", unknown), ("missing", missing), ("named twice", twice))
        if found
    ]
    if problems:
        raise GoalRefused(
            GoalCode.INVALID_JOINTS, f"joint_names: {'; '.join(problems)} (joints here: {', '.join(joints)})"
        )
    return tuple(joints.index(name) for name in names)


def _points(points: Sequence[Point], order: tuple[int, ...]) -> Waypoints:
    for index, point in enumerate(points):
        _check_lengths(index, point, len(order))
    _check_presence(points)
    axes = list(np.argsort(order))
    positions = np.array([point.positions for point in points], np.float64)[:, axes]
    times_s = np.array([point.time_s for point in points], np.float64)
    _check_times(times_s)
    velocities, accelerations = (
        np.array([getattr(point, name) for point in points], np.float64)[:, axes] if getattr(points[0], name) else None
        for name in ("velocities", "accelerations")
    )
    return Waypoints(times_s, positions, velocities, accelerations)


def _check_times(times_s: FloatArray) -> None:
    if not np.isfinite(times_s).all() or times_s[0] < 0.0:
        raise GoalRefused(GoalCode.INVALID_GOAL, "points[0].time_from_start: is negative")
    early = np.flatnonzero(np.diff(times_s) <= 0.0)
    if early.size:
        index = int(early[0]) + 1
        raise GoalRefused(
            GoalCode.INVALID_GOAL,
            f"points[{index}].time_from_start: {times_s[index]:.6g} s does not come after "
            f"{times_s[index - 1]:.6g} s of the point before; times must increase",
        )


def _check_lengths(index: int, point: Point, n_joints: int) -> None:
    for name in ("positions", "velocities", "accelerations"):
        values = getattr(point, name)
        if len(values) != n_joints and (values or name == "positions"):
            raise GoalRefused(
                GoalCode.INVALID_GOAL, f"points[{index}].{name}: {len(values)} values for {n_joints} joints"
            )
        if not all(map(math.isfinite, values)):
            raise GoalRefused(GoalCode.INVALID_GOAL, f"points[{index}].{name}: not finite")
    if point.effort:
        raise GoalRefused(
            GoalCode.INVALID_GOAL, f"points[{index}].effort: no efforts can be commanded, the engine takes positions"
        )


def _check_presence(points: Sequence[Point]) -> None:
    """All points of a curve must have the same fields: a missing one would be ambiguous."""
    for name in ("velocities", "accelerations"):
        given = [index for index, point in enumerate(points) if getattr(point, name)]
        if given and len(given) < len(points):
            missing = next(index for index in range(len(points)) if index not in given)
            raise GoalRefused(
                GoalCode.INVALID_GOAL, f"points[{missing}].{name}: none, but points[{given[0]}] has them: all or none"
            )
    if points[0].accelerations and not points[0].velocities:
        raise GoalRefused(GoalCode.INVALID_GOAL, "points[0].accelerations: need velocities as well")


def _check_end(points: Waypoints, joints: tuple[str, ...]) -> None:
    """The last point must be at rest, because the engine's spline ends at rest."""
    if points.velocities is None:
        return
    axis = int(np.argmax(np.abs(points.velocities[-1])))
    if abs(points.velocities[-1, axis]) > STANDS_RADPS:
        raise GoalRefused(
            GoalCode.INVALID_GOAL,
            f"points[{len(points) - 1}].velocities: {joints[axis]} ends at {points.velocities[-1, axis]:g} rad/s, "
            "must be 0",
        )


def _start_in_s(stamp_s: float, duration_s: float, max_delay_s: float, now_s: float) -> float:
    """Negative if the start has passed."""
    if stamp_s == 0.0:
        return 0.0
    if stamp_s + duration_s < now_s:
        over_s = now_s - stamp_s - duration_s
        raise GoalRefused(
            GoalCode.OLD_HEADER_TIMESTAMP, f"trajectory.header.stamp: the trajectory ended {over_s:.3f} s ago"
        )
    if stamp_s - now_s > max_delay_s:
        raise GoalRefused(
            GoalCode.INVALID_GOAL,
            f"trajectory.header.stamp: {stamp_s - now_s:.1f} s in the future, at most {max_delay_s:g} s",
        )
    return stamp_s - now_s


def _goal_time_s(asked_s: float, default_s: float) -> float:
    if not math.isfinite(asked_s) or asked_s < 0.0:
        raise GoalRefused(GoalCode.INVALID_GOAL, "goal_time_tolerance: is negative")
    return asked_s or default_s
