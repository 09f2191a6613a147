"""Correction of sightings from latched dockings: at a closed latch the robot stands exactly at the dock pose.

Mounting errors of camera and board, and errors of the intrinsics, show as a sighting that differs from the dock
pose. The difference, measured while the robot stands at the closed latch, is subtracted from later sightings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robot_stack.core.geometry import IDENTITY, Pose2, wrap_angle


@dataclass(frozen=True, slots=True)
class Correction:
    """``pose`` composed with a sighted dock pose (in base_link) gives the true one. dockings: number of samples."""

    pose: Pose2 = IDENTITY
    dockings: int = 0

    def apply(self, sighted: Pose2) -> Pose2:
        return self.pose.compose(sighted)


def learnt(
    before: Correction, sighted: Sequence[Pose2], dock_pose: Pose2, share: float, largest_m: float, largest_rad: float
) -> Correction | str:
    """The correction after one more latched docking, or the reason why there is none.

    sighted: measured dock in base_link, uncorrected, while standing at the closed latch. dock_pose: base_link in the
    dock frame. share: weight of the new measurement; the first counts in full. largest_*: limits of a calibration
    error.
    """
    if not sighted:
        return "the board was not detected at the closed latch"
    count = len(sighted)
    first = sighted[0]
    mean = Pose2(
        sum(pose.x for pose in sighted) / count,
        sum(pose.y for pose in sighted) / count,
        wrap_angle(first.yaw + sum(wrap_angle(pose.yaw - first.yaw) for pose in sighted) / count),
    )
    found = dock_pose.inverse().compose(mean.inverse())
    beside = mean.inverse().relative_to(dock_pose)
    if not found.is_finite() or math.hypot(beside.x, beside.y) > largest_m or abs(beside.yaw) > largest_rad:
        return (
            f"camera and latch differ by {1e3 * math.hypot(beside.x, beside.y):.1f} mm and "
            f"{math.degrees(abs(beside.yaw)):.2f} deg: a camera or a board is displaced"
        )
    if not before.dockings:
        return Correction(found, 1)
    step = found.relative_to(before.pose)
    part = Pose2(share * step.x, share * step.y, share * step.yaw)
    return Correction(before.pose.compose(part), before.dockings + 1)
