"""A docking controller for tests: real actions over DDS that succeed, fail, reject, hang or cancel slowly."""

from __future__ import annotations

import threading
import time
from collections.abc import Generator
from functools import partial
from typing import Any

import rclpy
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.context import Context
from rclpy.node import Node

from custom_msgs.action import Dock
from robot_stack.contract import actions
from robot_stack.contract.model import Action
from robot_stack.ros.executor import LeanExecutor
from robot_stack.ros.interfaces import interface_class
from tests.support.waiting import wait_for

_CLOSE_S = 30.0
_STEP_S = 0.15


class _Moment:
    """Yields to the executor when awaited."""

    def __await__(self) -> Generator[None]:
        yield


class FakeDocking:
    """Attributes determine the behaviour for the next goals; ``goals`` records the requested goals.

    rejects: goals are refused. hangs: a goal runs until it is cancelled. cancel_s: how long a cancelled goal takes to
    end. error: (code, reason) of a failure, None for success.
    """

    def __init__(self) -> None:
        self.rejects = self.hangs = False
        self.cancel_s = 0.0
        self.error: tuple[int, str] | None = None
        self.goals: list[tuple[str, str]] = []
        self.cancelled = 0
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node("docking_controller", context=self.context)
        self._servers = [
            ActionServer(
                self.node,
                interface_class(row.type),
                row.name,
                execute_callback=partial(self._execute, row),
                goal_callback=lambda _: GoalResponse.REJECT if self.rejects else GoalResponse.ACCEPT,
                cancel_callback=self._on_cancel,
            )
            for row in (actions.DOCK, actions.UNDOCK)
        ]
        self._executor = LeanExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def _on_cancel(self, _: Any) -> CancelResponse:
        self.cancelled += 1
        return CancelResponse.ACCEPT

    async def _execute(self, row: Action, goal: Any) -> Any:
        action = interface_class(row.type)
        self.goals.append((action.__name__.lower(), goal.request.dock_id))
        while not self.node.count_subscribers(f"{row.name}/_action/feedback"):
            await _Moment()  # discovered after the services
        for state in ("SERVOING", "FINE_ALIGN"):
            goal.publish_feedback(action.Feedback(state=state))
            await self._pause(_STEP_S)
        while self.hangs and not goal.is_cancel_requested:
            await _Moment()
        if goal.is_cancel_requested:
            await self._pause(self.cancel_s)
            goal.canceled()
            return action.Result(success=False, error_code=Dock.Result.CANCELED, reason="cancelled")
        if self.error is not None:
            goal.abort()
            return action.Result(success=False, error_code=self.error[0], reason=self.error[1])
        goal.succeed()
        return action.Result(success=True)

    async def _pause(self, seconds: float) -> None:
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            await _Moment()

    def close(self) -> None:
        self.hangs = False
        # Goals must end while the executor still spins, because a goal that outlives its server raises.
        wait_for(self.idle, "the goals' end", _CLOSE_S)
        self._executor.stop()
        self._thread.join(_CLOSE_S)
        for server in self._servers:
            server.destroy()
        self.node.destroy_node()
        self._executor.shutdown()
        rclpy.try_shutdown(context=self.context)

    def idle(self) -> bool:
        """True if no goal is executed."""
        return not self._executor._tasks
