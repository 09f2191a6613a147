"""The mission manager's client of navigate_to_pose: one goal at a time, reported as events with its number."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nav2_msgs.action import NavigateToPose
from robot_stack.contract import actions, frames
from robot_stack.core.geometry import Pose2
from robot_stack.middleware.conversions import pose_stamped
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.port import GoalStatus
from robot_stack.mission.events import (
    NavigationAborted,
    NavigationAccepted,
    NavigationCanceled,
    NavigationEvent,
    NavigationFeedback,
    NavigationLost,
    NavigationRejected,
    NavigationSucceeded,
)
from robot_stack.mission.nodes.goal_client import GoalClient

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

    def send(self, call: int, pose: Pose2) -> None:
        """Sends a goal, which preempts the one before."""
        self._client.start(call, NavigateToPose.Goal(pose=pose_stamped(pose, frames.MAP, self._node.stamp())))

    def poll(self) -> None:
        """Call in every tick."""
        self._client.poll()
        self._client.find_lost(_SILENCE_S)

    def accepted(self, call: int) -> None:
        self._report(NavigationAccepted(call))

    def rejected(self, call: int) -> None:
        self._report(NavigationRejected(call))

    def feedback(self, call: int, feedback: Any) -> None:
        self._report(NavigationFeedback(call, feedback.distance_remaining))

    def ended(self, call: int, status: GoalStatus, result: Any) -> None:
        match status:
            case GoalStatus.SUCCEEDED:
                self._report(NavigationSucceeded(call))
            case GoalStatus.ABORTED:
                self._report(NavigationAborted(call, result.error_code, result.error_msg))
            case GoalStatus.CANCELED:
                self._report(NavigationCanceled(call))
            case GoalStatus.UNKNOWN:
                self._report(NavigationLost(call))
