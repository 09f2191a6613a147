"""A client of navigate_to_pose: one goal at a time, reported as events with its number."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nav2_msgs.action import NavigateToPose
from robot_stack.contract import actions, frames
from robot_stack.core.goals import GoalStatus, NavigationEnded, NavigationEvent, NavigationFeedback, SendGoal
from robot_stack.middleware.conversions import pose_stamped
from robot_stack.middleware.goal_client import GoalClient
from robot_stack.middleware.node import StackNode

# Feedback comes at 5 Hz; without any for this time the server is asked whether it still has the goal.
_SILENCE_S = 1.0


class NavigationClient:
    """Callbacks run in the node's thread; ``report`` receives the goals' events."""

    def __init__(self, node: StackNode, report: Callable[[NavigationEvent], None]) -> None:
        self._node, self._report = node, report
        self._client = GoalClient(node, actions.NAVIGATE_TO_POSE, self)
        self.served = self._client.served
        self.cancel = self._client.cancel
        self.cancel_everything = self._client.cancel_everything

    def send(self, goal: SendGoal) -> None:
        """Sends a goal, which preempts the one before."""
        pose = pose_stamped(goal.pose, frames.MAP, self._node.stamp())
        self._client.start(goal.call, NavigateToPose.Goal(pose=pose))

    def poll(self) -> None:
        """Call in every tick."""
        self._client.poll()
        self._client.find_lost(_SILENCE_S)

    def accepted(self, call: int) -> None:
        """A goal that is not accepted in time ends as UNKNOWN."""

    def feedback(self, call: int, feedback: Any) -> None:
        self._report(NavigationFeedback(call, feedback.distance_remaining, feedback.number_of_recoveries))

    def ended(self, call: int, status: GoalStatus, result: Any) -> None:
        aborted = status is GoalStatus.ABORTED
        code, reason = (result.error_code, result.error_msg) if aborted else (0, "")
        self._report(NavigationEnded(call, status, code, reason))
