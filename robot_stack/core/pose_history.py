"""Poses of the last seconds, to find the pose at a stamp."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from dataclasses import dataclass

from robot_stack.core.geometry import Pose2

# A stamp that steps back by more than this is of a clock that was set back; one that steps back by less is late.
LATE_S = 0.1


@dataclass(frozen=True, slots=True)
class StampedPose:
    stamp_s: float
    pose: Pose2


@dataclass(frozen=True, slots=True)
class StepLimit:
    """The longest step of odometry that the robot can have driven, m/s, rad/s, m, rad; a longer one is a restart of its
    frame. slack_m, slack_rad: allowed beyond the speeds.
    """

    speed_mps: float
    yaw_rate_radps: float
    slack_m: float
    slack_rad: float

    def allows(self, step: Pose2, elapsed_s: float) -> bool:
        """step: from one pose to another, whose stamps are ``elapsed_s`` apart in either order."""
        near = math.hypot(step.x, step.y) <= self.speed_mps * abs(elapsed_s) + self.slack_m
        return near and abs(step.yaw) <= self.yaw_rate_radps * abs(elapsed_s) + self.slack_rad


class PoseHistory:
    """Poses in one frame in the order of their stamps, ``history_s`` of them."""

    def __init__(self, history_s: float) -> None:
        self._history_s = history_s
        self._items: deque[StampedPose] = deque()

    @property
    def newest(self) -> StampedPose | None:
        return self._items[-1] if self._items else None

    def is_set_back(self, stamp_s: float) -> bool:
        """True if a reading with this stamp shows that the clock was set back since the newest pose."""
        return bool(self._items) and self._items[-1].stamp_s - stamp_s > LATE_S

    def add(self, stamp_s: float, pose: Pose2) -> bool:
        """Appends a pose; False if it is not newer than the newest."""
        if self._items and stamp_s <= self._items[-1].stamp_s:
            return False
        self._items.append(StampedPose(stamp_s, pose))
        while stamp_s - self._items[0].stamp_s > self._history_s:
            self._items.popleft()
        return True

    def clear(self) -> None:
        self._items.clear()

    def at(self, stamp_s: float) -> Pose2 | None:
        """The pose at ``stamp_s``, interpolated linearly between its neighbours; None outside the history."""
        items = self._items
        if not items or not items[0].stamp_s <= stamp_s <= items[-1].stamp_s:
            return None
        after = bisect_right(items, stamp_s, key=lambda item: item.stamp_s)
        before = items[after - 1]
        if after == len(items):
            return before.pose
        share = (stamp_s - before.stamp_s) / (items[after].stamp_s - before.stamp_s)
        step = items[after].pose.relative_to(before.pose)
        return before.pose.compose(Pose2(share * step.x, share * step.y, share * step.yaw))
