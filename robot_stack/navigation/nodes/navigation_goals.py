"""The action navigate_to_pose, as Nav2 offers it: one goal at a time, which a newer goal preempts."""

from __future__ import annotations

from collections.abc import Callable

from geometry_msgs.msg import PoseStamped

from nav2_msgs.action import NavigateToPose
from robot_stack.contract import actions
from robot_stack.core.geometry import Twist2
from robot_stack.core.goals import GoalStatus
from robot_stack.middleware.conversions import duration_from_s
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.port import ActionGoal
from robot_stack.navigation.goal import GoalCode, GoalEnd

_PREEMPTED = GoalEnd(GoalStatus.ABORTED, "preempted by a newer goal")
# Below these the time is not estimated, as in Nav2.
_SLOWEST_MPS, _NEAREST_M = 0.01, 0.1


class NavigationGoals:
    """begin: receives each goal's pose, and the handle to pass to ``begin`` here."""

    def __init__(self, node: StackNode, begin: Callable[[PoseStamped, ActionGoal], None]) -> None:
        self._node = node
        self._goal: ActionGoal | None = None
        self._begun_s = 0.0
        self._accept = begin
        node.serve_action(actions.NAVIGATE_TO_POSE, self._on_goal)

    @property
    def cancel_requested(self) -> bool:
        return self._goal is not None and self._goal.is_cancel_requested

    @property
    def active(self) -> bool:
        """A goal with a handle is under way."""
        return self._goal is not None and self._goal.is_active

    def _on_goal(self, goal: ActionGoal) -> None:
        """A goal that asks for a behaviour tree is aborted, and the previous one continues, as in Nav2: it does not
        preempt a goal by one with another tree, and has none without a file."""
        if goal.request.behavior_tree:
            goal.abort(_result(GoalEnd(GoalStatus.ABORTED, "behavior_tree must be empty", GoalCode.INVALID)))
        else:
            self._accept(goal.request.pose, goal)

    def begin(self, goal: ActionGoal | None) -> None:
        """The controller has a new goal. goal: None for one of /goal_pose, which has no handle."""
        self.end(_PREEMPTED)
        self._goal, self._begun_s = goal, self._node.now_s()

    def end(self, end: GoalEnd) -> None:
        """Sends the result, if the goal has a handle."""
        goal, self._goal = self._goal, None
        if goal is None:
            return
        if end.succeeded:
            goal.succeed(_result(end))
        elif goal.is_cancel_requested:
            goal.cancel(_result(end))
        else:
            goal.abort(_result(end))

    def publish_feedback(self, pose: PoseStamped, twist: Twist2, remaining_m: float, recoveries: int) -> None:
        """Only while ``active``. pose: the robot's, in map. remaining_m: along the plan."""
        assert self._goal is not None
        speed = twist.speed()
        known = speed > _SLOWEST_MPS and remaining_m > _NEAREST_M
        self._goal.publish_feedback(
            NavigateToPose.Feedback(
                current_pose=pose,
                navigation_time=duration_from_s(max(0.0, self._node.now_s() - self._begun_s)),
                estimated_time_remaining=duration_from_s(remaining_m / speed if known else 0.0),
                number_of_recoveries=recoveries,
                distance_remaining=remaining_m,
            )
        )


def _result(end: GoalEnd) -> NavigateToPose.Result:
    """error_msg: empty on success."""
    text = "" if end.succeeded else end.text
    return NavigateToPose.Result(error_code=int(end.code), error_msg=text)
