"""Validation of goals, and how they end."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

from robot_stack.core.geometry import Pose2, yaw_from_quaternion
from robot_stack.core.goals import GoalStatus
from robot_stack.navigation.params import GoalParams

# Coordinates up to this are cells of a grid, as whole numbers, whatever its resolution.
_MOST_M = 1e9
_QUATERNION_TOLERANCE = 0.01  # of the squared norm: larger than any rounding


class GoalCode(IntEnum):
    """``error_code`` of NavigateToPose. As with Nav2, a code of FollowPath (100 to 199) or ComputePathToPose (200 to
    299).
    """

    NONE = 0
    STOPPED = 100  # FollowPath.UNKNOWN: an emergency stop
    PATIENCE_EXCEEDED = 104  # FollowPath: obstacles blocked every path for too long
    FAILED_TO_MAKE_PROGRESS = 105  # FollowPath: the robot does not follow its commands
    INVALID = 200  # ComputePathToPose.UNKNOWN: a field of the goal is out of its range
    TF_ERROR = 202  # ComputePathToPose: the goal is not in the map frame
    GOAL_OUTSIDE_MAP = 204  # ComputePathToPose
    GOAL_OCCUPIED = 206  # ComputePathToPose
    NO_VALID_PATH = 208  # ComputePathToPose: the map leaves no path


@dataclass(frozen=True, slots=True)
class GoalEnd:
    """How a goal ended. code: of an aborted goal. text: for people."""

    outcome: GoalStatus
    text: str
    code: GoalCode = GoalCode.NONE

    @property
    def succeeded(self) -> bool:
        return self.outcome is GoalStatus.SUCCEEDED

    @property
    def aborted(self) -> bool:
        return self.outcome is GoalStatus.ABORTED


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a goal is refused: ``text`` names field and limit."""

    code: GoalCode
    text: str


@dataclass(frozen=True, slots=True)
class GoalRequest:
    """A pose as received: position m, quaternion (x, y, z, w), stamp s (0: none)."""

    frame_id: str
    stamp_s: float
    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]

    @property
    def pose(self) -> Pose2:
        return Pose2(self.position[0], self.position[1], yaw_from_quaternion(*self.quaternion))


def refusal(
    request: GoalRequest, map_frame: str, now_s: float, from_pose: Pose2 | None, params: GoalParams
) -> Refusal | None:
    """Why the goal is refused, None if it is accepted.

    from_pose: where the robot is, None if unknown (then the distance is not checked yet).
    """
    if request.frame_id != map_frame:
        return Refusal(GoalCode.TF_ERROR, f"frame_id is {request.frame_id!r}, must be {map_frame!r}")
    problem = _invalid(request, now_s, params)
    if not problem and from_pose is not None:
        problem = too_far(request.pose, from_pose, params)
    return Refusal(GoalCode.INVALID, problem) if problem else None


def _invalid(request: GoalRequest, now_s: float, params: GoalParams) -> str:
    for name, values in (("position", request.position), ("orientation", request.quaternion)):
        if not all(map(math.isfinite, values)):
            return f"{name} is not finite: {values}"
    if max(map(abs, request.position)) > _MOST_M:
        return f"position is {request.position}, its coordinates must be within {_MOST_M:.0e} m"
    norm2 = sum(value * value for value in request.quaternion)
    if abs(norm2 - 1.0) > _QUATERNION_TOLERANCE:
        return f"orientation is no unit quaternion, its squared norm is {norm2:.3f}"
    age_s = now_s - request.stamp_s
    if request.stamp_s != 0.0 and not abs(age_s) <= params.max_age_s:
        return f"stamp is {age_s:.1f} s old, limit {params.max_age_s} s"
    return ""


def too_far(goal: Pose2, from_pose: Pose2, params: GoalParams) -> str:
    """Why the goal is too far away, else an empty text."""
    distance_m = from_pose.distance_to(goal)
    return (
        ""
        if distance_m <= params.max_distance_m
        else (f"goal is {distance_m:.1f} m away, limit {params.max_distance_m} m")
    )
