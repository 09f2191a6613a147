"""The action as a straightforward node serves it: a goal in a thread of rclpy's executor that polls every 10 ms."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
import rclpy
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node

from control_msgs.action import FollowJointTrajectory
from robot_stack.contract import actions
from robot_stack.ros import transport
from robot_stack.wmx import connect
from robot_stack.wmx.api import AdvMotion_PointTimeSplineCommand, AdvMotion_SplinePoint, AxisSelection, OperationState

_JOINTS = 6
_POLL_S = 0.01
_POINTS = 1000


class PlainTrajectoryServer(Node):
    """The same engine, action and spline; no checks, no feedback, no tolerances."""

    def __init__(self) -> None:
        super().__init__("plain_trajectory_server")
        self._engine = connect("plain_trajectory_server")
        self._lock = threading.Lock()
        code = self._engine.advanced_motion.advMotion.CreateSplineBuffer(1, _POINTS)
        assert code == 0, self._engine.advanced_motion.ErrorToString(code)
        ActionServer(
            self,
            FollowJointTrajectory,
            actions.FOLLOW_JOINT_TRAJECTORY.name,
            self._execute,
            callback_group=ReentrantCallbackGroup(),
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    def _execute(self, handle: Any) -> FollowJointTrajectory.Result:
        points = handle.request.trajectory.points
        rows = [AdvMotion_SplinePoint(list(point.positions)) for point in points]
        times_ms = [1e3 * point.time_from_start.sec + 1e-6 * point.time_from_start.nanosec for point in points]
        command = AdvMotion_PointTimeSplineCommand(_JOINTS, list(range(_JOINTS)))
        with self._lock:
            splines = self._engine.advanced_motion.advMotion
            code = splines.StartCSplinePos_PointTime(1, command, len(rows), rows, times_ms)
        result = FollowJointTrajectory.Result(error_code=code)
        if code:
            handle.abort()
            return result
        stopping = False
        while not self._idle():
            if handle.is_cancel_requested and not stopping:
                stopping = True
                with self._lock:
                    self._engine.core_motion.motion.Stop_AxisSel(AxisSelection.of(*range(_JOINTS)))
            time.sleep(_POLL_S)
        handle.canceled() if stopping else handle.succeed()
        return result

    def _idle(self) -> bool:
        with self._lock:
            code, snapshot = self._engine.read_status()
        return not code and bool(np.all(snapshot.op_state[:_JOINTS] == OperationState.Idle))


def main() -> None:
    transport.apply()
    rclpy.init()
    executor = MultiThreadedExecutor(4)
    try:
        executor.add_node(PlainTrajectoryServer())
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
