"""Which messages wake a node, which it takes without a wake-up, and which clock it uses."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import rclpy
from geometry_msgs.msg import Twist
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Bool

from custom_msgs.msg import SafetyStatus
from robot_stack.contract import topics
from robot_stack.core.node_record import NodeRecords
from robot_stack.core.world_clock import WorldClock
from robot_stack.middleware.node import StackNode
from robot_stack.ros.executor import LeanExecutor
from robot_stack.ros.port import RosPort
from tests.support.peer import Peer
from tests.support.waiting import wait_for


class Listener(StackNode):
    """Has the name of a node that commands and stops wake. Its tick is slow, so an earlier callback means a wake-up."""

    def __init__(self) -> None:
        super().__init__("swerve_controller")
        assert isinstance(self.port, RosPort)
        self.ros: RosPort = self.port
        self.ticks: list[float] = []
        self.taken: list[float] = []  # the age of each command
        self.stops: list[bool] = []  # for each stop: whether it arrived before a timer was due
        self.command = self.subscribe(topics.CMD_VEL, self._on_command)  # does not wake the node
        self.create_timer(0.5, lambda: self.ticks.append(self.steady_s()))

    def _on_command(self, _: Twist) -> None:
        self.taken.append(self.command.age_s())

    def on_emergency_stop(self) -> None:
        self.stops.append(self.is_early())

    def is_early(self) -> bool:
        """True if no timer is due, so that another event has woken the node."""
        return self.ros.schedules[0].next_due_s() > time.monotonic()


@contextmanager
def running(*arguments: str) -> Iterator[Listener]:
    rclpy.init(args=["--ros-args", *arguments], signal_handler_options=SignalHandlerOptions.NO)
    executor = LeanExecutor()
    node = Listener()
    executor.add_node(node.ros)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    try:
        yield node
    finally:
        executor.stop()
        thread.join(5.0)
        node.destroy_node()
        executor.shutdown()
        rclpy.try_shutdown()


def test_a_stop_wakes_a_node_and_a_command_waits_for_its_tick(ros_domain: int, peer: Peer) -> None:
    with running() as node:
        peer.wait_matched(topics.CMD_VEL)
        peer.wait_matched(topics.EMERGENCY_STOP)
        for number in range(1, 6):
            peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
            wait_for(lambda count=number: len(node.stops) == count, "the stop")
            peer.publish(topics.EMERGENCY_STOP, Bool(data=False))
            before = node.safety_status_input.received
            peer.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state="EMERGENCY_STOP"), 20.0)
            wait_for(lambda count=before: node.safety_status_input.received > count, "the emergency")
            peer.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state="NORMAL"), 20.0)
            wait_for(lambda: not node.emergency_stop, "the release")
            peer.silence(topics.SAFETY_STATUS)
        assert any(node.stops), "each waited for a timer"
        for number in range(1, 5):
            peer.publish(topics.CMD_VEL, Twist())
            wait_for(lambda count=number: len(node.taken) == count, "the command")
        # The age counts from the reception, not from the processing.
        assert max(node.taken) > 0.01


def test_urgent_message_wakes_node_for_earlier_messages(ros_domain: int, peer: Peer) -> None:
    with running() as node:
        peer.wait_matched(topics.CMD_VEL)
        peer.wait_matched(topics.EMERGENCY_STOP)
        peer.publish(topics.CMD_VEL, Twist())
        peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
        wait_for(lambda: node.stops, "the stop")
        wait_for(lambda: node.taken, "the command")


def test_timers_follow_a_worlds_clock_in_shared_memory(ros_domain: int, peer: Peer) -> None:
    clock = WorldClock.make()
    clock.write(100.0, 0.001, 1.0)
    with running("-p", "use_sim_time:=true") as node:
        assert node.simulated_time
        assert not peer.node.get_subscriptions_info_by_topic("/clock"), "it costs no message"
        records = NodeRecords()
        for number in range(1, 5):
            now_s = 100.0 + 0.5 * (number - 1)
            wait_for(lambda now_s=now_s: now_s < records.due_s("swerve_controller") < now_s + 1.0, "a node that sleeps")
            assert len(node.ticks) == number - 1, "time stands still"
            clock.write(now_s + 0.5, 0.001, 1.0)
            wait_for(lambda count=number: len(node.ticks) == count, "a tick")
        assert node.ticks == pytest.approx([100.5, 101.0, 101.5, 102.0], abs=0.01)
        assert 102.0 <= node.now_s() <= 102.002
        wait_for(lambda: (said := records.read("swerve_controller")) and said.beats > 3, "heartbeats in real time")


def test_a_node_whose_callback_takes_long_is_late_by_its_record(ros_domain: int) -> None:
    clock = WorldClock.make()
    clock.write(100.0, 0.001, 1.0)
    go_on, begun = threading.Event(), threading.Event()

    def slow() -> None:
        begun.set()
        go_on.wait(20.0)

    with running("-p", "use_sim_time:=true") as node:
        records = NodeRecords()
        wait_for(lambda: 100.0 < records.due_s("swerve_controller") < 101.0, "a node that sleeps")
        node.call_soon(slow)
        assert begun.wait(20.0)
        clock.write(105.0, 0.001, 1.0)
        assert records.due_s("swerve_controller") < 101.0
        go_on.set()
        wait_for(lambda: records.due_s("swerve_controller") > 105.0, "the node to be up to date")


def test_a_node_whose_thread_computes_is_late_by_its_record(ros_domain: int) -> None:
    clock = WorldClock.make()
    clock.write(100.0, 0.001, 1.0)
    with running("-p", "use_sim_time:=true") as node:
        records, worker = NodeRecords(), node.worker("awaited", world_waits=True)
        wait_for(lambda: 100.0 < records.due_s("swerve_controller") < 101.0, "a node that sleeps")
        clock.write(100.02, 0.0, 1.0)
        go_on, results = threading.Event(), []
        node.call_soon(lambda: worker.submit(lambda: go_on.wait(60.0), results.append))
        wait_for(lambda: records.due_s("swerve_controller") == pytest.approx(100.02), "the work on its record")
        clock.write(105.0, 0.001, 1.0)
        wait_for(lambda: len(node.ticks) >= 1, "a tick")
        assert records.due_s("swerve_controller") == pytest.approx(100.02)
        go_on.set()
        wait_for(lambda: records.due_s("swerve_controller") > 105.0, "the node to be up to date")
        assert results == [True]


def test_a_clock_is_chosen_at_the_start(ros_domain: int) -> None:
    with running() as node:
        (result,) = node.ros.set_parameters([Parameter("use_sim_time", value=True)])
        assert not result.successful
        assert "start" in result.reason


def test_call_soon_wakes_a_node(ros_domain: int) -> None:
    with running() as node:
        called: list[bool] = []
        for number in range(1, 6):
            node.call_soon(lambda: called.append(node.is_early()))
            wait_for(lambda count=number: len(called) == count, "the call")
        assert any(called), "each waited for a timer"


def test_a_subscription_that_has_ended_is_taken_no_more(ros_domain: int, peer: Peer) -> None:
    with running() as node:
        peer.wait_matched(topics.CMD_VEL)
        assert commands_in(node.ros.subscriptions)
        assert commands_in(node.ros.taken_at_tick)
        node.call_soon(lambda: node.unsubscribe(node.command))
        wait_for(lambda: not commands_in(node.ros.subscriptions), "the end of the subscription")
        assert not commands_in(node.ros.taken_at_tick)
        ticks = len(node.ticks)
        peer.publisher(topics.CMD_VEL).publish(Twist())  # the other side may have disconnected
        wait_for(lambda: len(node.ticks) > ticks + 1, "two more ticks")
        assert node.taken == []


def test_reception_times_of_a_subscription_never_fall(ros_domain: int) -> None:
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = Listener()
    try:
        times: list[float] = []
        node.ros.subscribe(
            topics.CMD_VEL, "/other", lambda _, received_s: times.append(received_s), 2, wakes=False, raw=False
        )
        (take,) = [item.callback for item in node.ros.subscriptions if item.topic_name == "/other"]
        for waited_ns in (0, 3_600_000_000_000):  # the system clock steps by an hour in between
            take(Twist(), {"received_timestamp": time.time_ns() - waited_ns})
        assert times[1] == times[0]
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def commands_in(subscriptions: Iterable[Any]) -> bool:
    return topics.CMD_VEL.name in [item.topic_name for item in subscriptions]
