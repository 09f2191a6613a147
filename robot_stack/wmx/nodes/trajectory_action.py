"""The action FollowJointTrajectory: every goal is accepted, and answered by the result of its execution."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.task import Future

from robot_stack.contract import actions
from robot_stack.middleware.node import StackNode
from robot_stack.wmx.nodes.trajectory_messages import result_to_msg
from robot_stack.wmx.trajectory.results import Outcome, Result


class Job:
    """A goal that is being worked on."""

    def __init__(self, handle: Any) -> None:
        self.handle = handle
        self.done = Future()
        self.order: tuple[int, ...] = ()

    def publish_feedback(self, feedback: Any) -> None:
        self.handle.publish_feedback(feedback)

    def end(self, result: Result) -> None:
        self.done.set_result(result)


class TrajectoryAction:
    """begin: starts a job, which ends it some time later; cancel: asks for its end."""

    def __init__(self, node: StackNode, name: str, begin: Callable[[Job], None], cancel: Callable[[Job], None]) -> None:
        self._begin, self._cancel = begin, cancel
        self._jobs: dict[bytes, Job] = {}
        row = actions.FOLLOW_JOINT_TRAJECTORY
        self._server = ActionServer(node, node.check_action(row), name, self._execute, cancel_callback=self._on_cancel)

    @property
    def busy(self) -> bool:
        """A goal has not been answered yet."""
        return bool(self._jobs)

    def look_for_cancellations(self) -> None:
        """A cancellation that is accepted takes effect after its callback: only then may the goal end as canceled."""
        for job in list(self._jobs.values()):
            if job.handle.is_cancel_requested and not job.done.done():
                self._cancel(job)

    @staticmethod
    def _on_cancel(_: Any) -> CancelResponse:
        return CancelResponse.ACCEPT

    async def _execute(self, handle: Any) -> Any:
        job = Job(handle)
        key = bytes(handle.goal_id.uuid)
        self._jobs[key] = job
        self._begin(job)
        result: Result = await job.done
        del self._jobs[key]
        if result.outcome is Outcome.SUCCEEDED:
            handle.succeed()
        elif result.outcome is Outcome.CANCELED:
            handle.canceled()
        else:
            handle.abort()
        return result_to_msg(result)
