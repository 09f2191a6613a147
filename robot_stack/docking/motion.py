"""Jerk-limited references of the approach, and the tracking command.

All poses here are base_link in the frame of the dock pose: x = 0, y = 0, yaw = 0 is docked. ``approach_sign`` is +1
for a robot that docks forwards (it comes from negative x) and -1 for one that docks backwards.

Each reference is one or two ruckig trajectories, so that position, speed and acceleration are continuous from the first
movement to standstill: the robot does not stop in between.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from ruckig import InputParameter, Result, Ruckig, Synchronization, Trajectory
from scipy.optimize import brentq

from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2, wrap_angle
from robot_stack.docking.params import MotionParams

Three = tuple[float, float, float]
_AT_REST: Three = (0.0, 0.0, 0.0)
# A start faster than the limits by this much is brought within them first: ruckig would brake instead of failing.
_TIGHT = 1e-6


@dataclass(frozen=True, slots=True)
class Point:
    """A sample of a reference: pose, and velocity in the same frame (not rotated into base_link)."""

    pose: Pose2
    velocity: Twist2


class Reference:
    """A trajectory to a pose, as a function of the time since its start."""

    def __init__(self, *parts: Trajectory) -> None:
        self._parts = parts
        self.duration_s = float(sum(part.duration for part in parts))

    def at(self, time_s: float) -> Point:
        """The sample ``time_s`` after the start; from the end on: the goal at rest."""
        remaining_s = max(time_s, 0.0)
        for part in self._parts:
            if remaining_s <= part.duration or part is self._parts[-1]:
                remaining_s = min(remaining_s, part.duration)
                position, velocity, _ = part.at_time(remaining_s)
                return Point(Pose2(*position), Twist2(*velocity))
            remaining_s -= part.duration
        raise AssertionError("a reference has a part")


def approach(start: Point, approach_sign: float, params: MotionParams) -> Reference:
    """From anywhere before the dock to the dock pose: fast until ``final_m`` before it, then slowly straight in."""
    before_m = -approach_sign * start.pose.x
    if before_m <= params.final_m:
        return Reference(_trajectory(start, Pose2(0.0, 0.0, 0.0), ZERO_TWIST, params, params.final_mps))
    start = _slow_enough(start, approach_sign, before_m - params.final_m, params)
    gate = Pose2(-approach_sign * params.final_m, 0.0, 0.0)
    through = Twist2(approach_sign * params.final_mps, 0.0, 0.0)
    first = _trajectory(start, gate, through, params, params.along_mps)
    last = _trajectory(Point(gate, through), Pose2(0.0, 0.0, 0.0), ZERO_TWIST, params, params.final_mps)
    return Reference(first, last)


def _slow_enough(start: Point, approach_sign: float, distance_m: float, params: MotionParams) -> Point:
    """``start``, its speed towards the dock limited to slow down to ``final_mps`` within ``distance_m``.

    For a faster robot, a reference that keeps its acceleration would return to the gate and enter the last
    centimetres too fast. If the reference begins slower than the robot, the drive's own limits brake it
    several times as hard.
    """
    velocity = start.velocity
    fastest_mps = _fastest_before(distance_m, params)
    if approach_sign * velocity.vx <= fastest_mps:
        return start
    return Point(start.pose, Twist2(approach_sign * fastest_mps, velocity.vy, velocity.omega))


def _fastest_before(distance_m: float, params: MotionParams) -> float:
    """The speed from which ``distance_m`` is just enough to slow down to ``final_mps``, m/s."""
    final_mps, acceleration, jerk = params.final_mps, params.acceleration_mps2, params.jerk_mps3

    def needed_m(speed_mps: float) -> float:
        lost_mps = speed_mps - final_mps
        reaches_full = lost_mps >= acceleration**2 / jerk
        duration_s = lost_mps / acceleration + acceleration / jerk if reaches_full else 2.0 * math.sqrt(lost_mps / jerk)
        return 0.5 * (speed_mps + final_mps) * duration_s - distance_m

    if needed_m(params.along_mps) <= 0.0:
        return params.along_mps
    return float(brentq(needed_m, final_mps, params.along_mps)) * (1.0 - _TIGHT)


def straight_to(start: Point, goal: Pose2, params: MotionParams) -> Reference:
    """To ``goal`` at rest, each coordinate independently."""
    return Reference(_trajectory(start, goal, ZERO_TWIST, params, params.along_mps))


def _trajectory(start: Point, goal: Pose2, through: Twist2, params: MotionParams, along_mps: float) -> Trajectory:
    """Coordinates that need less time than the distance along x finish earlier; else all arrive together."""
    given = InputParameter(3)
    given.current_position = [start.pose.x, start.pose.y, start.pose.yaw]
    given.current_velocity = _bounded(start.velocity, along_mps, params)
    given.current_acceleration = list(_AT_REST)
    given.target_position = [goal.x, goal.y, start.pose.yaw + wrap_angle(goal.yaw - start.pose.yaw)]
    given.target_velocity = [through.vx, through.vy, through.omega]
    given.target_acceleration = list(_AT_REST)
    given.max_velocity = [along_mps, min(params.across_mps, along_mps), params.turning_radps]
    given.max_acceleration = [params.acceleration_mps2, params.acceleration_mps2, params.acceleration_radps2]
    given.max_jerk = [params.jerk_mps3, params.jerk_mps3, params.jerk_radps3]
    given.synchronization = Synchronization.No
    trajectory = _solved(given)
    along_s, *others_s = trajectory.independent_min_durations
    if max(others_s) > along_s:
        given.synchronization = Synchronization.Time
        trajectory = _solved(given)
    return trajectory


def _solved(given: InputParameter) -> Trajectory:
    trajectory = Trajectory(3)
    result = Ruckig(3).calculate(given, trajectory)
    if result not in (Result.Working, Result.Finished):
        raise ValueError(f"no reference from {given.current_position} to {given.target_position}: {result}")
    return trajectory


def _bounded(velocity: Twist2, along_mps: float, params: MotionParams) -> list[float]:
    limits = (along_mps, min(params.across_mps, along_mps), params.turning_radps)
    values = (velocity.vx, velocity.vy, velocity.omega)
    return [max(-limit, min(limit, value)) * (1.0 - _TIGHT) for value, limit in zip(values, limits, strict=True)]


class Follower:
    """Tracks a reference. The reference waits for a robot that is slowed down."""

    def __init__(self, reference: Reference, params: MotionParams) -> None:
        self._reference = reference
        self._params = params
        self._elapsed_s = 0.0

    @property
    def finished(self) -> bool:
        """True if the reference has ended; the robot may still have an error."""
        return self._elapsed_s >= self._reference.duration_s

    def step(self, pose: Pose2, dt_s: float) -> Twist2:
        """The command in base_link for a robot at ``pose``; advances the reference by ``dt_s`` at most."""
        error = self._reference.at(self._elapsed_s).pose.relative_to(pose)
        self._elapsed_s += min(max(dt_s, 0.0), self._params.longest_step_s) * self._pace(error)
        point = self._reference.at(self._elapsed_s)
        moving = ZERO_TWIST if self.finished else into_base(point.velocity, pose.yaw)
        back = correction(point.pose.relative_to(pose), self._params)
        return Twist2(moving.vx + back.vx, moving.vy + back.vy, moving.omega + back.omega)

    def _pace(self, error: Pose2) -> float:
        p = self._params
        return min(
            _falling(math.hypot(error.x, error.y), p.wait_from_m, p.wait_at_m),
            _falling(abs(error.yaw), p.wait_from_rad, p.wait_at_rad),
        )


def correction(error: Pose2, params: MotionParams) -> Twist2:
    """The command that removes ``error`` (the wanted pose in base_link), as a twist of bounded size."""
    x, y = params.position_gain_per_s * error.x, params.position_gain_per_s * error.y
    size = math.hypot(x, y)
    part = min(1.0, params.max_correction_mps / size) if size > 0.0 else 0.0
    turn = float(np.clip(params.yaw_gain_per_s * error.yaw, -params.max_correction_radps, params.max_correction_radps))
    return Twist2(part * x, part * y, turn)


def into_base(velocity: Twist2, yaw_rad: float) -> Twist2:
    """Rotates a velocity from the dock pose's frame into base_link, whose yaw in it is ``yaw_rad``."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return Twist2(c * velocity.vx + s * velocity.vy, -s * velocity.vx + c * velocity.vy, velocity.omega)


def from_base(twist: Twist2, yaw_rad: float) -> Twist2:
    """The inverse of :func:`into_base`."""
    return into_base(twist, -yaw_rad)


def _falling(value: float, from_: float, to: float) -> float:
    return min(1.0, max(0.0, (to - value) / (to - from_)))
