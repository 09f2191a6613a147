"""The action FollowJointTrajectory: every goal is accepted; its execution's result is the answer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robot_stack.contract import actions
from robot_stack.core.goals import GoalStatus
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.port import ActionGoal
from robot_stack.wmx.nodes.trajectory_messages import result_to_msg
from robot_stack.wmx.trajectory.results import Result


class Job:
    """An active goal."""

    def __init__(self, goal: ActionGoal, ended: Callable[[Job], None]) -> None:
        self.goal = goal
        self.order: tuple[int, ...] = ()
        self._ended = ended

    def publish_feedback(self, feedback: Any) -> None:
        self.goal.publish_feedback(feedback)

    def end(self, result: Result) -> None:
        self._ended(self)
        goal = self.goal
        send = {GoalStatus.SUCCEEDED: goal.succeed, GoalStatus.CANCELED: goal.cancel, GoalStatus.ABORTED: goal.abort}
        send[result.outcome](result_to_msg(result))


class TrajectoryAction:
    """begin: starts a job, which ends the goal later; cancel: requests its end."""

    def __init__(self, node: StackNode, name: str, begin: Callable[[Job], None], cancel: Callable[[Job], None]) -> None:
        self._begin, self._cancel = begin, cancel
        self._jobs: dict[bytes, Job] = {}
        node.serve_action(actions.FOLLOW_JOINT_TRAJECTORY, self._on_goal, name)

    @property
    def busy(self) -> bool:
        """True while a goal has no answer yet."""
        return bool(self._jobs)

    def look_for_cancellations(self) -> None:
        """A cancellation takes effect after its callback; only then may the goal end as canceled."""
        for job in list(self._jobs.values()):
            if job.goal.is_cancel_requested:
                self._cancel(job)

    def _on_goal(self, goal: ActionGoal) -> None:
        job = self._jobs[goal.goal_id] = Job(goal, self._forget)
        self._begin(job)

    def _forget(self, job: Job) -> None:
        del self._jobs[job.goal.goal_id]
