"""The actions /docking/dock and /docking/undock: one goal at a time, answered by the controller's results."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robot_stack.contract import actions
from robot_stack.docking.nodes.messages import dock_feedback, dock_result, undock_feedback, undock_result
from robot_stack.docking.results import DockCode, Result, UndockCode
from robot_stack.docking.situation import Output
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.port import ActionGoal

_CANCELLED = (DockCode.CANCELED, UndockCode.CANCELED)


class _Job:
    """A goal that is being worked on."""

    def __init__(self, goal: ActionGoal, feedback: Callable[[Output], Any], result: Callable[[Result], Any]) -> None:
        self.goal = goal
        self.feedback = feedback
        self._result = result

    def end(self, result: Result) -> None:
        message = self._result(result)
        if result.success:
            self.goal.succeed(message)
        elif result.code in _CANCELLED and self.goal.is_cancel_requested:
            self.goal.cancel(message)
        else:
            self.goal.abort(message)


class DockingActions:
    """begin_dock, begin_undock: start a job; they return its refusal or None."""

    def __init__(
        self,
        node: StackNode,
        begin_dock: Callable[[str, bool], Result | None],
        begin_undock: Callable[[str], Result | None],
    ) -> None:
        self._begin_dock, self._begin_undock = begin_dock, begin_undock
        self._job: _Job | None = None
        node.serve_action(actions.DOCK, self._dock)
        node.serve_action(actions.UNDOCK, self._undock)

    @property
    def cancel_requested(self) -> bool:
        return self._job is not None and self._job.goal.is_cancel_requested

    def publish_feedback(self, output: Output) -> None:
        """Feedback of the present job."""
        if self._job is not None and self._job.goal.is_active:
            self._job.goal.publish_feedback(self._job.feedback(output))

    def end(self, result: Result) -> None:
        """The present job is over."""
        job, self._job = self._job, None
        if job is not None:
            job.end(result)

    def _dock(self, goal: ActionGoal) -> None:
        refusal = self._begin_dock(goal.request.dock_id, goal.request.approach_only)
        self._begin(_Job(goal, dock_feedback, dock_result), refusal)

    def _undock(self, goal: ActionGoal) -> None:
        self._begin(_Job(goal, undock_feedback, undock_result), self._begin_undock(goal.request.dock_id))

    def _begin(self, job: _Job, refusal: Result | None) -> None:
        if refusal is None:
            self._job = job
        else:
            job.end(refusal)
