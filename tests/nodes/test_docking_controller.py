"""The docking controller as a process, beside a simulated engine and a peer that plays everything else."""

from __future__ import annotations

import signal
from collections.abc import Callable
from typing import Any

import pytest
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient
from std_msgs.msg import Bool

from custom_msgs.action import Dock, Undock
from custom_msgs.msg import ArucoDetectionArray, SafetyStatus
from robot_stack.contract import actions, topics
from robot_stack.docking.nodes.attached_file import AttachedFile
from tests.support.peer import Peer
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for

Start = Callable[..., NodeProcess]


class Bench:
    """The node in a stack that stands still: odometry, pose, safety and empty images come from the peer."""

    def __init__(self, start: Start, peer: Peer) -> None:
        self.peer = peer
        self.safety = SafetyStatus(safety_state=SafetyStatus.NORMAL)
        self.status = peer.listen(topics.DOCKING_STATUS)
        self.command = peer.listen(topics.DOCKING_CMD_VEL)
        self.goal = peer.listen(topics.GOAL_POSE)
        self.passenger = peer.listen(topics.PASSENGER_ATTACHED)
        peer.publisher(topics.EMERGENCY_STOP)
        self._dock = ActionClient(peer.node, Dock, actions.DOCK.name)
        self._undock = ActionClient(peer.node, Undock, actions.UNDOCK.name)
        start("sim_world")
        start("swerve_hardware_interface")  # starts the engine's bus, without which no input can be read
        self.process = start("docking_controller")
        for row, make in (
            (topics.ODOM, self._odometry),
            (topics.SAFETY_STATUS, lambda: self.safety),
            (topics.ARUCO_DETECTIONS, self._images),
        ):
            peer.repeat(row, make, row.rate_hz or 10.0)
        self.status.wait(lambda _: True, "a docking status", 30.0)
        wait_for(lambda: self._dock.server_is_ready() and self._undock.server_is_ready(), "the actions", 20.0)
        wait_for(lambda: self.passenger.last is not None, "word about the passenger", 20.0)

    def _stamp(self) -> Any:
        return self.peer.node.get_clock().now().to_msg()

    def _odometry(self) -> Odometry:
        message = Odometry()
        message.header.stamp = self._stamp()
        message.pose.pose.orientation.w = 1.0
        return message

    def _images(self) -> ArucoDetectionArray:
        message = ArucoDetectionArray()
        message.header.stamp = self._stamp()
        return message

    def send(self, client: ActionClient, goal: Any) -> Any:
        sent = self.peer.in_loop(lambda: client.send_goal_async(goal))
        wait_for(sent.done, "an answer to the goal")
        return sent.result()

    def result(self, handle: Any) -> Any:
        future = self.peer.in_loop(handle.get_result_async)
        wait_for(future.done, "the result", 20.0)
        return future.result().result

    def dock(self, dock_id: str = "chair_1") -> Any:
        return self.send(self._dock, Dock.Goal(dock_id=dock_id))

    def undock(self) -> Any:
        return self.send(self._undock, Undock.Goal())


@pytest.fixture
def bench(start: Start, peer: Peer) -> Bench:
    return Bench(start, peer)


def test_wrong_wishes_are_answered_with_a_reason_and_move_nothing(bench: Bench) -> None:
    assert bench.passenger.last.data is False
    unknown = bench.result(bench.dock("nowhere"))
    assert (unknown.success, unknown.error_code) == (False, Dock.Result.UNKNOWN_DOCK)
    assert "chair_1" in unknown.reason
    nothing = bench.result(bench.undock())
    assert (nothing.success, nothing.error_code) == (False, Undock.Result.NOT_ATTACHED)
    first = bench.dock()
    second = bench.result(bench.dock())
    assert second.error_code == Dock.Result.BUSY
    cancelled = first.cancel_goal_async()
    wait_for(cancelled.done, "the cancellation")
    assert bench.result(first).error_code == Dock.Result.CANCELED
    bench.status.wait(lambda message: message.state == "IDLE", "idle again")
    assert all(item.twist.linear.x == 0.0 and item.twist.angular.z == 0.0 for item in bench.command.messages)


def test_docking_sends_the_staging_pose_and_ends_on_an_emergency_stop(bench: Bench) -> None:
    handle = bench.dock()
    bench.status.wait(lambda message: message.state == "APPROACH", "the approach")
    goal = bench.goal.wait(lambda message: message.header.frame_id == "map", "a goal").pose
    assert (goal.position.x, goal.position.y) == pytest.approx((-2.05, 11.0))
    bench.peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
    result = bench.result(handle)
    assert (result.error_code, result.reason) == (Dock.Result.SAFETY_STOP, "emergency stop")
    assert bench.status.last.state in ("APPROACH", "FAILED")
    bench.status.wait(lambda message: message.state == "FAILED", "the failure")


def test_the_status_comes_at_its_rate_and_the_process_leaves_in_order(bench: Bench) -> None:
    bench.status.wait_period(0.1, count=31)
    assert len(bench.command.items) == 0
    bench.process.signal(signal.SIGINT)
    assert bench.process.wait() == 0


def test_a_chair_that_came_loose_while_the_controller_was_dead_is_an_emergency_with_the_passenger_aboard(
    bench: Bench, start: Start
) -> None:
    stops = bench.peer.listen(topics.EMERGENCY_STOP)
    sources = bench.peer.listen(topics.EMERGENCY_STOP_SOURCES)
    bench.process.signal(signal.SIGKILL)
    bench.process.wait()
    assert AttachedFile().save(True) == ""  # as it would be, had it carried somebody
    bench.passenger.items.clear()
    start("docking_controller")
    stops.wait(lambda message: message.data, "the emergency stop")
    sources.wait(lambda message: message.name == "docking_controller" and message.pressed, "its author")
    bench.passenger.wait(lambda message: message.data, "a passenger aboard")
    bench.status.wait(lambda message: message.state == "FAILED", "the failure")
    assert all(message.data for message in bench.passenger.messages)
