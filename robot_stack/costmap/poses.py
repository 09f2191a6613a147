"""Where base_link was in odom at the time of a cloud."""

from __future__ import annotations

from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2, exp_se2
from robot_stack.core.pose_history import PoseHistory
from robot_stack.costmap.params import OdometryParams


class Poses:
    """Odometry by stamp."""

    def __init__(self, params: OdometryParams) -> None:
        self._params = params
        self._history = PoseHistory(params.history_s)
        self._twist = ZERO_TWIST

    def add(self, stamp_s: float, pose: Pose2, twist: Twist2) -> bool:
        """Takes finite odometry. False if it does not continue what was there: another odometry began."""
        newest = self._history.newest
        continues = newest is None or (
            pose.distance_to(newest.pose) <= self._params.jump_m and stamp_s > newest.stamp_s - self._params.history_s
        )
        if not continues:
            self._history.clear()
        if self._history.add(stamp_s, pose):
            self._twist = twist
        return continues

    def at(self, stamp_s: float) -> Pose2 | None:
        """The pose at a stamp; a little ahead of the newest one by its twist; None where nobody knows."""
        newest = self._history.newest
        if newest is not None and 0.0 < stamp_s - newest.stamp_s <= self._params.ahead_s:
            return newest.pose.compose(exp_se2(self._twist, stamp_s - newest.stamp_s))
        return self._history.at(stamp_s)
