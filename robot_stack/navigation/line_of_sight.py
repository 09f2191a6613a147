"""Checks whether the exact motion straight to the goal is clear, and how fast. Otherwise a route is followed."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import wrap_angle
from robot_stack.core.robot import Footprint
from robot_stack.navigation.motion import Trajectory
from robot_stack.navigation.params import NavigationParams
from robot_stack.navigation.speed_limits import narrow_speed
from robot_stack.navigation.world_model import WorldModel

Array = npt.NDArray[np.float64]
_SPACING_M, _MOST_SAMPLES = 0.1, 300
_LOOK_S = 2.5
_SPEED_STEP_MPS = 0.1
# A goal with less clearance than this is occupied.
_OCCUPIED_M = 0.05
# A motion that has begun may come this much nearer to the limit of the way back.
_BACK_SLACK_M = 0.05


def is_direct(
    trajectory: Trajectory,
    from_s: float,
    around: WorldModel,
    footprint: Footprint,
    params: NavigationParams,
    now_s: float,
    *,
    entering: bool,
) -> bool:
    """Whether the rest of the motion from ``from_s`` on is clear of obstacles, people and closed doors.

    Against one-way zones, only a motion is clear that is not longer than what the robot has left of
    ``one_way.back_m``; in a site with lanes one shorter than ``straight_m``.
    entering: the motion has not begun; this requires more clearance and a heading along the motion.
    """
    if around.free_space:
        return True
    poses = sampled(trajectory, from_s, trajectory.duration_s)
    if around.doors.closed_from(footprint, poses) < len(poses):
        return False
    f, end = params.follow, poses[-1]
    left = np.hypot(poses[:, 0] - end[0], poses[:, 1] - end[1])
    if left[0] > around.straight_m:
        return False
    if entering and left[0] > f.direct_any_heading_m and not _looks_ahead(poses[0], end, f.direct_heading_rad):
        return False
    clear = around.clearance_m(footprint, poses)
    if clear[-1] < _OCCUPIED_M:
        return False
    back_m = params.one_way.back_m - around.back_m + (0.0 if entering else _BACK_SLACK_M)
    if left[0] > back_m and around.against_m(poses) > 0.0:
        return False
    # A goal near to an obstacle reduces the required clearance.
    near_m = min(f.direct_end_margin_m, float(clear[-1]) - 0.02)
    margin = f.direct_margin_m if entering else f.direct_leave_m
    needed = np.where(left > f.direct_near_m, margin, near_m)
    if not bool(np.all(clear >= needed)):
        return False
    # On arrival the robot is slow, so the allowed distance to people is smaller.
    limit_m = min(f.direct_person_m, f.direct_end_person_m + float(left[0]))
    return around.person_m(poses[left >= left[0] - f.ahead_m], now_s, 0.6 * limit_m) > limit_m


def allowed_speed(
    trajectory: Trajectory,
    from_s: float,
    around: WorldModel,
    footprint: Footprint,
    params: NavigationParams,
    cruise_mps: float,
) -> float:
    """Speed allowed by the clearance and the zones of the next seconds, m/s in steps; infinite without a limit."""
    if around.free_space:
        return math.inf
    poses = sampled(trajectory, from_s, min(from_s + _LOOK_S, trajectory.duration_s))
    clear = np.array([around.clearance_m(footprint, poses).min()])
    narrow = float(narrow_speed(clear, cruise_mps, params.speed_limits)[0])
    speed = min(narrow, float(around.zone_speed_mps(poses).min()))
    if speed >= cruise_mps:
        return math.inf
    # 0.3 is 2.999 steps.
    return max(_SPEED_STEP_MPS, _SPEED_STEP_MPS * math.floor(speed / _SPEED_STEP_MPS + 1e-6))


def sampled(trajectory: Trajectory, from_s: float, to_s: float) -> Array:
    """(n, 3) poses of the motion between two times, about 0.1 m apart at the speed limit of a ride."""
    duration_s = max(to_s - from_s, 0.0)
    count = max(2, min(_MOST_SAMPLES, math.ceil(duration_s / _SPACING_M) + 1))
    states = (trajectory.at(float(time_s)).pose for time_s in np.linspace(from_s, to_s, count))
    return np.array([(pose.x, pose.y, pose.yaw) for pose in states])


def _looks_ahead(start: Array, end: Array, limit_rad: float) -> bool:
    course = math.atan2(end[1] - start[1], end[0] - start[0])
    return all(abs(wrap_angle(course - yaw)) <= limit_rad for yaw in (float(start[2]), float(end[2])))
