"""A simulated world waits for a route: it arrives after the same simulated time, however long the planning takes."""

from __future__ import annotations

import threading

import numpy as np
import rclpy
from rclpy.signals import SignalHandlerOptions

from robot_stack.core.geometry import Pose2
from robot_stack.core.node_record import NodeRecords
from robot_stack.core.world_clock import WorldClock
from robot_stack.navigation.cancel_flag import CancelFlag
from robot_stack.navigation.nodes.navigation_controller import NavigationControllerNode
from robot_stack.navigation.routes import RouteRequest, RouteResult, RouteSolver
from robot_stack.ros.executor import LeanExecutor
from tests.support.blind import BLIND
from tests.support.waiting import wait_for

NAME = "navigation_controller"


class Held(RouteSolver):
    """Plans only after the test permits it."""

    def __init__(self, solver: RouteSolver) -> None:
        self._solver = solver
        self.begun, self.resume = threading.Event(), threading.Event()

    def solve(self, question: RouteRequest, stop: CancelFlag) -> RouteResult:
        self.begun.set()
        self.resume.wait(60.0)
        return self._solver.solve(question, stop)


def test_the_record_is_late_from_the_question_to_the_answer(ros_domain: int) -> None:
    clock = WorldClock.make()
    clock.write(100.0, 0.001, 1.0)
    rclpy.init(args=["--ros-args", "-p", "use_sim_time:=true", *BLIND], signal_handler_options=SignalHandlerOptions.NO)
    executor, node = LeanExecutor(), NavigationControllerNode()
    executor.add_node(node.port)
    planner = node._planner
    held = planner._solver = Held(planner._solver)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    records = NodeRecords()
    try:
        wait_for(lambda: 100.0 < records.due_s(NAME) < 100.1, "a node that sleeps")
        seen = np.empty((0, 2))
        question = RouteRequest(Pose2(0.0, 0.0, 0.0), Pose2(5.0, 0.0, 0.0), node.robot.footprint, seen)
        node.call_soon(lambda: planner.ask(question))
        assert held.begun.wait(60.0)
        wait_for(lambda: records.due_s(NAME) < 100.01, "the question on the record")
        ticked = threading.Event()
        clock.write(103.0, 0.001, 1.0)
        wait_for(lambda: node.port.schedules[0].next_due_s() > 103.0, "ticks that go on")
        node.call_soon(ticked.set)
        assert ticked.wait(60.0)
        wait_for(lambda: records.due_s(NAME) < 100.01, "a record that is late still")
        held.resume.set()
        wait_for(lambda: records.due_s(NAME) > 103.01, "the node to be up to date")
        answer = wait_for(planner.take, "the answer")
        assert answer.route is not None
    finally:
        held.resume.set()
        executor.stop()
        thread.join(10.0)
        node.destroy_node()
        executor.shutdown()
        rclpy.try_shutdown()
