"""The actions /docking/dock and /docking/undock: one goal at a time, answered by the controller's results."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.task import Future

from robot_stack.contract import actions
from robot_stack.docking.nodes.messages import dock_feedback, dock_result, undock_feedback, undock_result
from robot_stack.docking.results import DockCode, Result, UndockCode
from robot_stack.docking.situation import Output
from robot_stack.middleware.node import StackNode

_CANCELLED = (DockCode.CANCELED, UndockCode.CANCELED)


class _Job:
    """A goal that is being worked on."""

    def __init__(self, handle: Any, feedback: Callable[[Output], Any]) -> None:
        self.handle = handle
        self.feedback = feedback
        self.done = Future()


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
        self._servers = [
            ActionServer(
                node,
                node.check_action(row),
                row.name,
                execute,
                cancel_callback=lambda _: CancelResponse.ACCEPT,
            )
            for row, execute in ((actions.DOCK, self._dock), (actions.UNDOCK, self._undock))
        ]

    @property
    def cancel_requested(self) -> bool:
        return self._job is not None and self._job.handle.is_cancel_requested

    def publish_feedback(self, output: Output) -> None:
        """Feedback of the present job."""
        if self._job is not None and self._job.handle.is_active:
            self._job.handle.publish_feedback(self._job.feedback(output))

    def end(self, result: Result) -> None:
        """The present job is over."""
        if self._job is not None:
            self._job.done.set_result(result)
            self._job = None

    async def _dock(self, handle: Any) -> Any:
        refusal = self._begin_dock(handle.request.dock_id, handle.request.approach_only)
        return dock_result(await self._result(handle, dock_feedback, refusal))

    async def _undock(self, handle: Any) -> Any:
        refusal = self._begin_undock(handle.request.dock_id)
        return undock_result(await self._result(handle, undock_feedback, refusal))

    async def _result(self, handle: Any, feedback: Callable[[Output], Any], refusal: Result | None) -> Result:
        if refusal is None:
            self._job = _Job(handle, feedback)
            result: Result = await self._job.done
        else:
            result = refusal
        if result.success:
            handle.succeed()
        elif result.code in _CANCELLED and handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        return result
