"""A docking controller for tests: real actions over DDS that succeed, fail, reject, hang or cancel slowly."""

from __future__ import annotations

import threading
import time
from collections.abc import Generator
from typing import Any

import rclpy
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.context import Context
from rclpy.node import Node

from custom_msgs.action import Dock, Undock
from custom_msgs.msg import DockingStatus
from robot_stack.contract import actions, topics
from robot_stack.ros.executor import LeanExecutor
from robot_stack.ros.interfaces import interface_class, qos_profile
from tests.support.waiting import wait_for

_CLOSE_S = 30.0


class _Moment:
    """Yields to the executor when awaited."""

    def __await__(self) -> Generator[None]:
        yield


class FakeDocking:
    """Attributes determine the behaviour for the next goals; ``goals`` records the requested goals.

    rejects: goals are refused. hangs: a goal runs until it is cancelled. cancel_s: how long a cancelled goal takes to
    end. error: (code, reason) of a failure, None for success. steps: states of the feedback before the end, each for
    step_s.
    """

    def __init__(self) -> None:
        self.rejects = self.hangs = False
        self.cancel_s = 0.0
        self.error: tuple[int, str] | None = None
        self.steps: tuple[str, ...] = ("SERVOING", "FINE_ALIGN")
        self.step_s = 0.15
        self.goals: list[tuple[str, str]] = []
        self.cancelled = 0
        self._state = "IDLE"
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node("docking_controller", context=self.context)
        self._status = self._publisher(topics.DOCKING_STATUS)
        self.node.create_timer(0.1, self._tell)
        self._servers = [
            ActionServer(
                self.node,
                interface_class(row.type),
                row.name,
                execute_callback=execute,
                goal_callback=lambda _: GoalResponse.REJECT if self.rejects else GoalResponse.ACCEPT,
                cancel_callback=self._on_cancel,
            )
            for row, execute in ((actions.DOCK, self._dock), (actions.UNDOCK, self._undock))
        ]
        self._executor = LeanExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._closing = False
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def _publisher(self, row: Any) -> Any:
        return self.node.create_publisher(interface_class(row.type), row.name, qos_profile(row.qos))

    def _tell(self) -> None:
        self._status.publish(DockingStatus(state=self._state))

    def _on_cancel(self, _: Any) -> CancelResponse:
        self.cancelled += 1
        return CancelResponse.ACCEPT

    async def _dock(self, goal: Any) -> Dock.Result:
        self.goals.append(("dock", goal.request.dock_id))
        return await self._execute(goal, Dock, Dock.Result.CANCELED)

    async def _undock(self, goal: Any) -> Undock.Result:
        self.goals.append(("undock", goal.request.dock_id))
        return await self._execute(goal, Undock, Undock.Result.CANCELED)

    async def _execute(self, goal: Any, action: Any, canceled: int) -> Any:
        try:
            for state in self.steps:
                self._state = state if action is Dock else "DOCKED"
                goal.publish_feedback(action.Feedback(state=state))
                if await self._wait(goal, self.step_s):
                    return await self._cancel(goal, action, canceled)
            if self.hangs and await self._wait(goal, 3600.0):
                return await self._cancel(goal, action, canceled)
        finally:
            self._state = "IDLE"
        if self.error is not None:
            goal.abort()
            return action.Result(success=False, error_code=self.error[0], reason=self.error[1])
        goal.succeed()
        return action.Result(success=True)

    async def _wait(self, goal: Any, seconds: float) -> bool:
        """Returns True as soon as the goal is cancelled or this server closes."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            if goal.is_cancel_requested or self._closing:
                return True
            await _Moment()
        return False

    async def _cancel(self, goal: Any, action: Any, canceled: int) -> Any:
        end_s = time.monotonic() + self.cancel_s
        while time.monotonic() < end_s and not self._closing:
            await _Moment()
        if goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.abort()
        return action.Result(success=False, error_code=canceled, reason="cancelled")

    def close(self) -> None:
        self._closing = True
        # Goals must end while the executor still spins, because a goal that outlives its server raises.
        wait_for(lambda: not self._executor._tasks, "the goals' end", _CLOSE_S)
        self._executor.stop()
        self._thread.join(_CLOSE_S)
        for server in self._servers:
            server.destroy()
        self.node.destroy_node()
        self._executor.shutdown()
        rclpy.try_shutdown(context=self.context)
