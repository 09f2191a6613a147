"""An operator's commands to the arm: a trajectory, sent and followed to its end, and the gripper."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from robot_stack.cli.nodes.docking_goals import Ended, follow_action
from robot_stack.cli.nodes.operator import Operator
from robot_stack.contract import actions, services

Waypoint = tuple[float, Sequence[float]]


def follow_trajectory(
    joints: Sequence[str], waypoints: Sequence[Waypoint], report: Callable[[Any], None], timeout_s: float
) -> Ended:
    """Moves the arm through ``waypoints``, (s from the start, rad per joint). See ``follow_action``."""
    points = [
        JointTrajectoryPoint(positions=list(positions), time_from_start=_duration(time_s))
        for time_s, positions in waypoints
    ]
    trajectory = JointTrajectory(joint_names=list(joints), points=points)
    return follow_action(actions.FOLLOW_JOINT_TRAJECTORY, {"trajectory": trajectory}, report, timeout_s, _end)


def set_gripper(close: bool, timeout_s: float) -> tuple[bool, str]:
    """(success, message) of the trajectory server. Raises NoAnswer."""
    with Operator() as operator:
        response = operator.call(services.SET_GRIPPER, timeout_s, data=close)
        return response.success, response.message


def _duration(seconds: float) -> Duration:
    whole, nanoseconds = divmod(round(seconds * 1e9), 1_000_000_000)
    return Duration(sec=whole, nanosec=nanoseconds)


def _end(answer: Any) -> Ended:
    result = answer.result
    if answer.status == GoalStatus.STATUS_SUCCEEDED:
        return Ended(True, "")
    if answer.status == GoalStatus.STATUS_CANCELED:
        return Ended(False, "canceled, the arm is at standstill")
    return Ended(False, f"{result.error_string or 'no reason given'} (error {result.error_code})")
