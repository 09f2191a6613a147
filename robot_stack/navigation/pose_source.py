"""The present pose in map: the newest ``/current_pose``, propagated by the odometry since its stamp.

``/current_pose`` is accurate but arrives at 10 Hz and late; ``/odom`` is smooth at 50 Hz but drifts. The pose of the
odom frame in map hardly changes: it is computed at the stamps of the former and applied to the latter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_stack.core.geometry import IDENTITY, Pose2, Twist2, exp_se2
from robot_stack.core.pose_history import PoseHistory, StampedPose, StepLimit
from robot_stack.navigation.params import PoseParams


@dataclass(frozen=True, slots=True)
class Located:
    """Where the robot is now (map) and how it moves (base_link). map_to_odom: pose of the odom frame in map."""

    pose: Pose2
    twist: Twist2
    map_to_odom: Pose2 = IDENTITY


class PoseSource:
    """Stamps are ROS time, receptions steady time.

    max_speed_mps, max_yaw_rate_radps: the robot's limits; a faster step of the odometry means a new odom frame.
    """

    def __init__(self, params: PoseParams, max_speed_mps: float, max_yaw_rate_radps: float) -> None:
        self._params = params
        fastest = params.max_speed_factor * max_speed_mps, params.max_speed_factor * max_yaw_rate_radps
        self._steps = StepLimit(*fastest, params.jump_tolerance_m, params.jump_tolerance_rad)
        self._odometry = PoseHistory(params.history_s)
        self._twist = Twist2(0.0, 0.0, 0.0)
        self._odometry_received_s = -math.inf
        self._fix: StampedPose | None = None
        self._fix_received_s = -math.inf
        self._map_to_odom: Pose2 | None = None
        self._applied_s = -math.inf  # reception of the fix in map_to_odom

    def on_odometry(self, stamp_s: float, pose: Pose2, twist: Twist2, received_s: float) -> str:
        """Takes a message of ``/odom``. Returns why it was refused, else an empty text."""
        if not (math.isfinite(stamp_s) and pose.is_finite() and twist.is_finite()):
            return f"/odom is not finite: {pose}, {twist}"
        last = self._odometry.newest
        if last is not None and not self._continues(last, stamp_s, pose):
            # Another odom frame, or another clock: the old data is invalid.
            self._odometry.clear()
            self._map_to_odom = None
            self._fix = None
        if not self._odometry.add(stamp_s, pose):
            return ""  # older than the newest one
        self._twist, self._odometry_received_s = twist, received_s
        self._apply_fix()
        return ""

    def on_pose(self, stamp_s: float, pose: Pose2, received_s: float) -> str:
        """Takes a message of ``/current_pose``. Returns why it was refused, else an empty text."""
        if not (math.isfinite(stamp_s) and pose.is_finite()):
            return f"/current_pose is not finite: {pose}"
        if self._fix is not None and stamp_s == self._fix.stamp_s:
            return ""  # a duplicate, which does not reset the age
        self._fix, self._fix_received_s = StampedPose(stamp_s, pose), received_s
        self._apply_fix()
        return ""

    def located(self, now_s: float, steady_s: float) -> tuple[Located | None, str]:
        """(the robot's location, empty text), or (None, the reason)."""
        fix_age_s, odometry_age_s = steady_s - self._fix_received_s, steady_s - self._odometry_received_s
        if not 0.0 <= fix_age_s <= self._params.pose_timeout_s:
            return None, _silent("/current_pose", fix_age_s, self._params.pose_timeout_s)
        if not 0.0 <= odometry_age_s <= self._params.odometry_timeout_s:
            return None, _silent("/odom", odometry_age_s, self._params.odometry_timeout_s)
        newest = self._odometry.newest
        fits = steady_s - self._applied_s <= self._params.pose_timeout_s
        if self._map_to_odom is None or newest is None or not fits:
            return None, "no /current_pose that fits the stamps of /odom"
        ahead_s = min(max(now_s - newest.stamp_s, 0.0), self._params.max_extrapolation_s)
        pose = self._map_to_odom.compose(newest.pose).compose(exp_se2(self._twist, ahead_s))
        return Located(pose, self._twist, self._map_to_odom), ""

    def _continues(self, last: StampedPose, stamp_s: float, pose: Pose2) -> bool:
        dt_s = stamp_s - last.stamp_s
        known = not self._odometry.is_set_back(stamp_s) and dt_s <= self._params.history_s
        return known and self._steps.allows(pose.relative_to(last.pose), dt_s)

    def _apply_fix(self) -> None:
        """Computes map_to_odom at the fix's stamp, once the odometry covers it."""
        if self._fix is None:
            return
        odometry = self._odometry.at(self._fix.stamp_s)
        if odometry is not None:
            self._map_to_odom = self._fix.pose.compose(odometry.inverse())
            self._applied_s = self._fix_received_s


def _silent(name: str, age_s: float, limit_s: float) -> str:
    if not math.isfinite(age_s):
        return f"{name} never received"
    return f"{name} silent for more than {limit_s} s"
