"""A docking controller for tests: real actions over DDS that succeed, fail, reject, hang, die or cancel slowly."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator
from typing import Any

import rclpy
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.context import Context
from rclpy.node import Node
from std_msgs.msg import Bool

from custom_msgs.action import Dock, Undock
from custom_msgs.msg import DockingStatus
from robot_stack.contract import actions, topics
from robot_stack.ros.executor import LeanExecutor
from robot_stack.ros.interfaces import interface_class, qos_profile
from tests.support.waiting import wait_for

_CLOSE_S = 30.0


class _Moment:
    """Awaited, it lets the executor do something else."""

    def __await__(self) -> Generator[None]:
        yield


class _Wire:
    """Between an action server and DDS: what is lost there, as messages are while a new process is being discovered."""

    def __init__(self, handle: Any, docking: FakeDocking) -> None:
        self._handle = handle
        self._docking = docking

    def __getattr__(self, name: str) -> Any:
        return getattr(self._handle, name)

    def __enter__(self) -> Any:
        return self._handle.__enter__()

    def __exit__(self, *error: Any) -> None:
        self._handle.__exit__(*error)

    def take_goal_request(self, request_type: Any) -> Any:
        taken = self._handle.take_goal_request(request_type)
        return (None, None) if self._docking.loses_goals else taken

    def send_goal_response(self, header: Any, response: Any) -> None:
        if not self._docking.loses_answers:
            self._handle.send_goal_response(header, response)


class FakeDocking:
    """What it does with the next goals is in its attributes; ``goals`` notes what it was asked for.

    loses_goals, loses_answers: the one or the other never arrives.
    rejects: goals are refused. hangs: a goal goes on until it is cancelled. cancel_s: how long a cancelled goal takes
    to end. error: (code, reason) of a failure, None for success. attaches: /passenger_attached follows a success.
    steps: states of the feedback before the end, each for step_s.
    """

    def __init__(self, context: Context | None = None) -> None:
        self.rejects = self.hangs = self.loses_goals = self.loses_answers = False
        self.cancel_s = 0.0
        self.error: tuple[int, str] | None = None
        self.attaches = True
        self.steps: tuple[str, ...] = ("SERVOING", "FINE_ALIGN")
        self.step_s = 0.15
        self.goals: list[tuple[str, str]] = []
        self.cancelled = 0
        self._state = "IDLE"
        self.context = context or Context()
        if context is None:
            rclpy.init(context=self.context)
        self.node = Node("docking_controller", context=self.context)
        self._status = self._publisher(topics.DOCKING_STATUS)
        self._passenger = self._publisher(topics.PASSENGER_ATTACHED)
        self._status_timer = self.node.create_timer(0.1, self._tell)
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
        for server in self._servers:
            server._handle = _Wire(server._handle, self)
        self._executor = LeanExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._closing = False
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def _publisher(self, row: Any) -> Any:
        return self.node.create_publisher(interface_class(row.type), row.name, qos_profile(row.qos))

    def _tell(self) -> None:
        self._status.publish(DockingStatus(state=self._state))

    def silence(self) -> None:
        self.node.destroy_timer(self._status_timer)

    def attach(self, attached: bool) -> None:
        self._passenger.publish(Bool(data=attached))

    def _on_cancel(self, _: Any) -> CancelResponse:
        self.cancelled += 1
        return CancelResponse.ACCEPT

    async def _dock(self, goal: Any) -> Dock.Result:
        self.goals.append(("dock", goal.request.dock_id))
        return await self._execute(goal, Dock, Dock.Result.CANCELED, attached=True)

    async def _undock(self, goal: Any) -> Undock.Result:
        self.goals.append(("undock", goal.request.dock_id))
        return await self._execute(goal, Undock, Undock.Result.CANCELED, attached=False)

    async def _execute(self, goal: Any, action: Any, canceled: int, *, attached: bool) -> Any:
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
        if self.attaches:
            self.attach(attached)
        goal.succeed()
        return action.Result(success=True)

    async def _wait(self, goal: Any, seconds: float) -> bool:
        """True as soon as the goal is cancelled (or this server closes)."""
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
        # Goals end while the executor still spins: what ends after its servers have gone raises.
        wait_for(lambda: not self._executor._tasks, "the goals' end", _CLOSE_S)
        self._executor.stop()
        self._thread.join(_CLOSE_S)
        for server in self._servers:
            server.destroy()
        self.node.destroy_node()
        self._executor.shutdown()
        rclpy.try_shutdown(context=self.context)


def main(configure: Callable[[FakeDocking], None] = lambda _: None) -> None:
    """Runs alone, for tests that kill it: ``python -m tests.support.docking [hang]``."""
    import sys

    from robot_stack.ros import transport

    transport.apply()
    server = FakeDocking()
    server.hangs = "hang" in sys.argv
    configure(server)
    print("serving", flush=True)
    server._thread.join()


if __name__ == "__main__":
    main()
