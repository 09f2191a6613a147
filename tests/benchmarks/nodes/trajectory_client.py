"""An action client like a motion planner's: sends trajectories, cancels them, receives the feedback."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration
from numpy.typing import NDArray
from rclpy.action import ActionClient
from trajectory_msgs.msg import JointTrajectoryPoint

from control_msgs.action import FollowJointTrajectory
from robot_stack.contract import actions
from robot_stack.ros import transport
from robot_stack.ros.tool_node import ToolNode
from tests.benchmarks.support.framework import BenchError

FloatArray = NDArray[np.float64]
_JOINTS = [f"joint{number}" for number in range(1, 7)]
_LONGEST_S = 30.0
_CANCELED = 5
# A planner's client exists long before its first goal. No call reports the server's discovery of the client.
_DISCOVERY_S = 1.0


class TrajectoryClient:
    """A context manager on ``domain``; ``feedback_errors``: the largest of each feedback, rad."""

    def __init__(self, domain: int) -> None:
        transport.apply()
        self._tool = ToolNode("trajectory_client", domain)
        self._client = ActionClient(self._tool.node, FollowJointTrajectory, actions.FOLLOW_JOINT_TRAJECTORY.name)
        self.feedback_errors: list[float] = []

    def __enter__(self) -> TrajectoryClient:
        self._wait(self._client.server_is_ready, "the trajectory server")
        ready_s = time.monotonic()
        self._wait(lambda: time.monotonic() - ready_s > _DISCOVERY_S, "the server to discover this client")
        return self

    def __exit__(self, *_: object) -> None:
        self._client.destroy()
        self._tool.close()

    def follow(self, times_s: FloatArray, rows: FloatArray) -> tuple[int, int, str]:
        """(monotonic time of sending in ns, error code, error text)."""
        sent_ns, handle = self._send(times_s, rows)
        result = self._result(handle)
        return sent_ns, result.result.error_code, result.result.error_string

    def cancel(self, times_s: FloatArray, rows: FloatArray, after_s: float) -> tuple[int, int]:
        """Monotonic times of the cancellation and of the result, ns."""
        sent_ns, handle = self._send(times_s, rows)
        result = handle.get_result_async()
        self._wait(lambda: time.monotonic_ns() - sent_ns > 1e9 * after_s, "the moment of cancellation")
        canceled_ns = time.monotonic_ns()
        handle.cancel_goal_async()
        self._wait(result.done, "the result")
        if result.result().status != _CANCELED:
            raise BenchError(f"canceled, but: {result.result().result.error_string}")
        return canceled_ns, time.monotonic_ns()

    def _send(self, times_s: FloatArray, rows: FloatArray) -> tuple[int, Any]:
        goal = FollowJointTrajectory.Goal()
        goal.trajectory.joint_names = _JOINTS
        goal.trajectory.points = [
            JointTrajectoryPoint(positions=row, time_from_start=_duration(time_s))
            for row, time_s in zip(rows.tolist(), times_s.tolist(), strict=True)
        ]
        sent_ns = time.monotonic_ns()
        sent = self._client.send_goal_async(goal, feedback_callback=self._on_feedback)
        self._wait(sent.done, "an answer to the goal")
        handle = sent.result()
        if not handle.accepted:
            raise BenchError("the goal was not accepted")
        return sent_ns, handle

    def _result(self, handle: Any) -> Any:
        future = handle.get_result_async()
        self._wait(future.done, "the result")
        return future.result()

    def _on_feedback(self, message: Any) -> None:
        self.feedback_errors.append(max(map(abs, message.feedback.error.positions)))

    def _wait(self, done: Callable[[], bool], what: str) -> None:
        end_s = time.monotonic() + _LONGEST_S
        while not done():
            if time.monotonic() > end_s:
                raise BenchError(f"timed out after {_LONGEST_S:g} s waiting for {what}")
            self._tool.executor.spin_once(0.002)


def _duration(seconds: float) -> Duration:
    whole, nanoseconds = divmod(round(1e9 * seconds), 1_000_000_000)
    return Duration(sec=whole, nanosec=nanoseconds)
