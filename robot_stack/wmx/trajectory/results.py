"""Result codes of a goal: control_msgs' codes, which are not positive, or a code of the engine, which is."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from robot_stack.core.goals import GoalStatus


class GoalCode(IntEnum):
    """The constants of control_msgs/action/FollowJointTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


@dataclass(frozen=True, slots=True)
class Fault:
    """The reason why a goal cannot continue. code: a GoalCode or a code of the engine."""

    code: int
    text: str


@dataclass(frozen=True, slots=True)
class Result:
    outcome: GoalStatus
    code: int
    text: str


class GoalRefused(Exception):
    """An invalid goal."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text)
        self.fault = Fault(code, text)


def succeeded(text: str) -> Result:
    return Result(GoalStatus.SUCCEEDED, GoalCode.SUCCESSFUL, text)


def canceled(text: str) -> Result:
    return Result(GoalStatus.CANCELED, GoalCode.SUCCESSFUL, text)


def aborted(fault: Fault) -> Result:
    return Result(GoalStatus.ABORTED, fault.code, fault.text)
