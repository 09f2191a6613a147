"""Validation of goals."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_stack.core.geometry import Pose2, yaw_from_quaternion
from robot_stack.navigation.params import GoalParams

_QUATERNION_TOLERANCE = 0.01  # of the squared norm: larger than any rounding


@dataclass(frozen=True, slots=True)
class GoalRequest:
    """A message of ``/goal_pose`` as received: position m, quaternion (x, y, z, w), stamp s (0: none)."""

    frame_id: str
    stamp_s: float
    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]

    @property
    def cancels(self) -> bool:
        return self.frame_id == ""

    @property
    def pose(self) -> Pose2:
        return Pose2(self.position[0], self.position[1], yaw_from_quaternion(*self.quaternion))


def refusal(request: GoalRequest, map_frame: str, now_s: float, from_pose: Pose2 | None, params: GoalParams) -> str:
    """Why the goal is refused, naming field and limit; an empty text if it is accepted.

    from_pose: where the robot is, None if unknown (then the distance is not checked yet).
    """
    if request.frame_id != map_frame:
        return f"frame_id is {request.frame_id!r}, must be {map_frame!r}"
    for name, values in (("position", request.position), ("orientation", request.quaternion)):
        if not all(map(math.isfinite, values)):
            return f"{name} is not finite: {values}"
    norm2 = sum(value * value for value in request.quaternion)
    if abs(norm2 - 1.0) > _QUATERNION_TOLERANCE:
        return f"orientation is no unit quaternion, its squared norm is {norm2:.3f}"
    age_s = now_s - request.stamp_s
    if request.stamp_s != 0.0 and not abs(age_s) <= params.max_age_s:
        return f"stamp is {age_s:.1f} s old, limit {params.max_age_s} s"
    return "" if from_pose is None else too_far(request.pose, from_pose, params)


def too_far(goal: Pose2, from_pose: Pose2, params: GoalParams) -> str:
    """Why the goal is too far away, else an empty text."""
    distance_m = from_pose.distance_to(goal)
    return (
        ""
        if distance_m <= params.max_distance_m
        else (f"goal is {distance_m:.1f} m away, limit {params.max_distance_m} m")
    )
