"""Drives a route pose by pose where it is narrow: turns on the spot, sideways and backward stretches included.

The sampling controller looks ahead along the route and cuts its corners, which a narrow place does not allow. There
the planned poses are driven exactly, slowly, with a stop before the first pose that is not clear.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import Pose2, Twist2, wrap_angle
from robot_stack.core.limits import MotionLimits
from robot_stack.navigation.params import PassageParams, TrackingParams
from robot_stack.navigation.path import Path
from robot_stack.navigation.tracker import bounded, settle_command

Array = npt.NDArray[np.float64]
_STEP_M = 0.05
# The place on the route is searched this far behind and ahead of the last one.
_BEHIND_M, _AHEAD_M = 0.1, 0.6


class PoseFollower:
    """Follows one route. Distances along it are efforts, m: the larger of the way and of turn_m times the turn."""

    def __init__(self, route: Path, params: PassageParams, tracking: TrackingParams) -> None:
        self._params, self._tracking = params, tracking
        yaw = np.unwrap(route.poses[:, 2])
        self._poses = np.column_stack((route.poses[:, :2], yaw))
        steps = np.diff(self._poses, axis=0)
        efforts = np.maximum(np.hypot(steps[:, 0], steps[:, 1]), params.turn_m * np.abs(steps[:, 2]))
        self._effort_m = np.concatenate(([0.0], np.cumsum(efforts)))
        self._at_m: float | None = None

    def locate(self, pose: Pose2) -> bool:
        """Finds the robot's place on the route. False if it is too far off to follow the poses.

        pose: map.
        """
        low, high = 0.0, float(self._effort_m[-1])
        if self._at_m is not None:
            low, high = max(low, self._at_m - _BEHIND_M), min(high, self._at_m + _AHEAD_M)
        at = np.arange(low, high + 0.5 * _STEP_M, _STEP_M)
        there = self._sampled(at)
        away = np.hypot(there[:, 0] - pose.x, there[:, 1] - pose.y)
        turned = np.abs((there[:, 2] - pose.yaw + math.pi) % (2.0 * math.pi) - math.pi)
        best = int(np.argmin(np.hypot(away, self._params.turn_m * turned)))
        near = bool(away[best] <= self._params.off_m and turned[best] <= self._params.off_rad)
        self._at_m = float(at[best]) if near else None
        return near

    def ahead(self, distance_m: float) -> Array:
        """(n, 3) poses in map from the robot's place on, ``_STEP_M`` of effort apart."""
        start_m = self._at_m or 0.0
        end_m = min(start_m + distance_m, float(self._effort_m[-1]))
        return self._sampled(np.arange(start_m, end_m + 0.5 * _STEP_M, _STEP_M))

    def command(self, pose: Pose2, ahead: Array, clear_m: Array, speed_mps: float, limits: MotionLimits) -> Twist2:
        """The motion, base_link, along the next poses.

        ahead: (n, 3) of ``ahead``. clear_m: (n,) clearance there. speed_mps: allowed by narrow places and people.
        """
        p = self._params
        # A robot that stands nearer may leave, but not come nearer still.
        needed_m = min(p.margin_m, float(clear_m[0]))
        blocked = np.flatnonzero(clear_m < needed_m)
        free_m = _STEP_M * (int(blocked[0]) - 1 if len(blocked) else len(ahead))
        speed_mps = min(speed_mps, p.speed_mps, math.sqrt(limits.acceleration_mps2 * max(free_m - _STEP_M, 0.0)))
        goal = Pose2(*map(float, ahead[min(2, len(ahead) - 1)]))
        if len(ahead) < 3:
            return settle_command(goal, pose, limits, self._tracking)
        pull = settle_command(Pose2(*map(float, ahead[0])), pose, limits, self._tracking)
        rate = speed_mps / (2.0 * _STEP_M)
        dx, dy = rate * (goal.x - ahead[0, 0]), rate * (goal.y - ahead[0, 1])
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        omega = rate * wrap_angle(goal.yaw - float(ahead[0, 2]))
        share = min(1.0, speed_mps / p.speed_mps)
        along = Twist2(c * dx + s * dy, -s * dx + c * dy, omega)
        twist = Twist2(along.vx + share * pull.vx, along.vy + share * pull.vy, along.omega + share * pull.omega)
        return bounded(twist, limits.speed_mps, limits.yaw_rate_radps)

    def _sampled(self, at_m: Array) -> Array:
        columns = (np.interp(at_m, self._effort_m, self._poses[:, i]) for i in range(3))
        return np.column_stack(list(columns))
