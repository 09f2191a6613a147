"""The lean executor behaves like rclpy's: services, clients, actions, coroutines, entities created and destroyed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from rclpy.action import ActionClient, ActionServer
from rclpy.context import Context
from rclpy.node import Node
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from custom_msgs.action import Undock
from robot_stack.ros.executor import LeanExecutor
from tests.support.waiting import wait_for


@pytest.fixture
def ros(ros_domain: int) -> Iterator[tuple[Node, LeanExecutor]]:
    context = Context()
    rclpy.init(context=context)
    node = Node("executor_test", context=context)
    executor = LeanExecutor(context=context)
    executor.add_node(node)
    yield node, executor
    node.destroy_node()
    executor.shutdown()
    rclpy.try_shutdown(context=context)


def _spin_until(executor: LeanExecutor, done: Any) -> None:
    wait_for(lambda: done() or executor.spin_once(0.05), "what the executor serves", poll_s=0.0)


def test_timer_publisher_and_late_subscription(ros: tuple[Node, LeanExecutor]) -> None:
    node, executor = ros
    publisher = node.create_publisher(Float64, "number", 1)
    node.create_timer(0.01, lambda: publisher.publish(Float64(data=1.0)))
    executor.spin_once(0.0)
    received: list[float] = []
    node.create_subscription(Float64, "number", lambda message: received.append(message.data), 1)
    _spin_until(executor, lambda: len(received) >= 3)
    assert received[0] == 1.0


def test_flood_of_one_topic_leaves_turns_to_timers(ros: tuple[Node, LeanExecutor]) -> None:
    """Each callback publishes the next message, so that one has always arrived."""
    node, executor = ros
    publisher = node.create_publisher(Float64, "flood", 1)
    messages: list[float] = []
    ticks: list[int] = []

    def flood(message: Float64) -> None:
        messages.append(message.data)
        assert len(messages) - ticks[-1] < 500, "no timer is served"
        publisher.publish(message)
        wait_for(executor._wakeups.pending, "the next message")

    node.create_subscription(Float64, "flood", flood, 5)
    node.create_timer(0.001, lambda: ticks.append(len(messages)))
    _spin_until(executor, lambda: ticks)
    publisher.publish(Float64())
    _spin_until(executor, lambda: len(set(ticks)) > 3)


def test_destroyed_subscription_is_silent_and_harmless(ros: tuple[Node, LeanExecutor]) -> None:
    node, executor = ros
    publisher = node.create_publisher(Float64, "number", 1)
    node.create_timer(0.005, lambda: publisher.publish(Float64(data=1.0)))
    received: list[float] = []
    subscription = node.create_subscription(Float64, "number", lambda message: received.append(message.data), 1)
    _spin_until(executor, lambda: received)
    node.destroy_subscription(subscription)
    count = len(received)
    for _ in range(20):
        executor.spin_once(0.01)
    assert len(received) == count


def test_service_and_client_in_one_executor(ros: tuple[Node, LeanExecutor]) -> None:
    node, executor = ros

    def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = True, "done"
        return response

    node.create_service(Trigger, "ask", answer)
    client = node.create_client(Trigger, "ask")
    _spin_until(executor, client.service_is_ready)
    future = client.call_async(Trigger.Request())
    _spin_until(executor, future.done)
    assert future.result().message == "done"


def test_coroutine_callback_awaits_a_service(ros: tuple[Node, LeanExecutor]) -> None:
    node, executor = ros
    node.create_service(Trigger, "ask", lambda _, response: response)
    client = node.create_client(Trigger, "ask")
    _spin_until(executor, client.service_is_ready)
    results: list[Any] = []

    async def once() -> None:
        timer.cancel()
        results.append(await client.call_async(Trigger.Request()))

    timer = node.create_timer(0.01, once)
    _spin_until(executor, lambda: results)
    assert results[0].success is False


def test_action_runs_to_its_result(ros: tuple[Node, LeanExecutor]) -> None:
    node, executor = ros

    def execute(goal: Any) -> Undock.Result:
        goal.succeed()
        return Undock.Result(success=True, reason="clear")

    server = ActionServer(node, Undock, "undock", execute)
    client = ActionClient(node, Undock, "undock")
    _spin_until(executor, client.server_is_ready)
    accepted = client.send_goal_async(Undock.Goal())
    _spin_until(executor, accepted.done)
    result = accepted.result().get_result_async()
    _spin_until(executor, result.done)
    assert result.result().result.reason == "clear"
    client.destroy()
    server.destroy()


def test_an_exception_in_a_callback_reaches_the_spinner(ros: tuple[Node, LeanExecutor]) -> None:
    node, executor = ros

    def fail() -> None:
        raise ValueError("broken")

    node.create_timer(0.01, fail)
    with pytest.raises(ValueError, match="broken"):
        _spin_until(executor, lambda: False)


def test_an_exception_in_a_service_reaches_the_spinner(ros: tuple[Node, LeanExecutor]) -> None:
    node, executor = ros

    def fail(_: Any, __: Any) -> Any:
        raise ValueError("broken service")

    node.create_service(Trigger, "ask", fail)
    client = node.create_client(Trigger, "ask")
    _spin_until(executor, client.service_is_ready)
    client.call_async(Trigger.Request())
    with pytest.raises(ValueError, match="broken service"):
        _spin_until(executor, lambda: False)
