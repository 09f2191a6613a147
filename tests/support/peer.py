"""A plain rclpy node beside the node under test: it publishes, subscribes and calls services in its own thread."""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node

from robot_stack.contract import topics
from robot_stack.contract.model import Durability, Service, Topic
from robot_stack.middleware.emergency_stop import StopSource
from robot_stack.ros.executor import LeanExecutor
from robot_stack.ros.interfaces import interface_class, qos_profile
from tests.support.waiting import DEADLINE_S, wait_for

_ASK_AGAIN_S = 10.0


class Received:
    """Messages that a peer has received on a topic: (steady time of reception, message) pairs."""

    def __init__(self) -> None:
        self.items: list[tuple[float, Any]] = []
        self.subscription: Any = None

    def on_message(self, message: Any) -> None:
        self.items.append((time.monotonic(), message))

    @property
    def messages(self) -> list[Any]:
        return [message for _, message in self.items]

    @property
    def last(self) -> Any:
        return self.items[-1][1] if self.items else None

    def wait_connected(self) -> None:
        """Waits until a publisher is discovered: messages published before are lost."""
        wait_for(self.subscription.get_publisher_count, f"a publisher of {self.subscription.topic_name}")

    def wait(self, condition: Callable[[Any], bool], what: str, deadline_s: float = DEADLINE_S) -> Any:
        """Returns the newest message or the first later one for which ``condition`` holds."""
        asked = max(0, len(self.items) - 1)

        def found() -> list[Any]:
            nonlocal asked
            begun, asked = asked, len(self.items)
            return [message for message in self.messages[begun:asked] if condition(message)]

        return wait_for(found, what, deadline_s, poll_s=0.002)[0]


def says(diagnostics: Received, node: str, text: str) -> dict[str, str]:
    """Waits for a new report with the text, once a second, and returns its values."""
    first = len(diagnostics.items)

    def matches(message: Any) -> bool:
        return message.status[0].name == node and text in message.status[0].message

    found = wait_for(lambda: next(filter(matches, diagnostics.messages[first:]), None), f"{node}: {text}")
    return {item.key: item.value for item in found.status[0].values}


class Peer:
    """A node that the contract does not restrict: tests publish any message."""

    def __init__(self, name: str = "peer") -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node(name, context=self.context)
        self._executor = LeanExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._publishers: dict[str, Any] = {}
        self._source: StopSource | None = None
        self._repeating: dict[str, Any] = {}
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def listen(self, row: Topic, callback: Callable[[Any], None] | None = None) -> Received:
        arrived = Received()

        def on_message(message: Any) -> None:
            arrived.on_message(message)
            if callback is not None:
                callback(message)

        arrived.subscription = self.node.create_subscription(
            interface_class(row.type), row.name, on_message, qos_profile(row.qos)
        )
        return arrived

    def publisher(self, row: Topic) -> Any:
        if row.name not in self._publishers:
            self._publishers[row.name] = self.node.create_publisher(
                interface_class(row.type), row.name, qos_profile(row.qos)
            )
        return self._publishers[row.name]

    def publish(self, row: Topic, message: Any) -> None:
        """On a volatile topic, waits for a connected subscriber before publishing, because later ones lose the message.

        One message is enough on reliable topics only: the subscriber may not have discovered this publisher yet.
        """
        publisher = self.publisher(row)
        if row.qos.durability is Durability.VOLATILE:
            self.wait_matched(row)
        publisher.publish(message)

    def stop_source(self) -> StopSource:
        """This peer as a source of the emergency stop that also publishes its reports."""
        if self._source is None:
            stop, reports = self.publisher(topics.EMERGENCY_STOP), self.publisher(topics.EMERGENCY_STOP_SOURCES)
            clock = self.node.get_clock()
            name = str(self.node.get_name())
            self._source = StopSource(name, os.getpid(), stop, reports, lambda: clock.now().to_msg())
            self.node.create_timer(0.2, self._source.repeat)
        return self._source

    def wait_matched(self, row: Topic, count: int = 1) -> None:
        """Waits until ``count`` subscribers of the topic are connected to this peer's publisher."""
        publisher = self.publisher(row)
        wait_for(lambda: publisher.get_subscription_count() >= count, f"{count} subscribers of {row.name}")

    def repeat(self, row: Topic, make: Callable[[], Any], rate_hz: float) -> None:
        """Publishes ``make()`` at ``rate_hz`` until ``silence`` or the end; a second call replaces the first."""
        self.silence(row)
        publisher = self.publisher(row)
        self._repeating[row.name] = self.node.create_timer(1.0 / rate_hz, lambda: publisher.publish(make()))

    def silence(self, row: Topic) -> None:
        timer = self._repeating.pop(row.name, None)
        if timer is not None:
            self.node.destroy_timer(timer)

    def serve(self, row: Service, callback: Callable[[Any, Any], Any]) -> None:
        self.node.create_service(interface_class(row.type), row.name, callback)

    def in_loop(self, function: Callable[[], Any]) -> Any:
        """Runs a function on the peer's thread and returns its result. rclpy registers a goal only after sending it: if
        another thread sends the goal, an immediate answer is dropped.
        """
        task = self._executor.create_task(function)
        wait_for(task.done, "the peer's own thread")
        return task.result()

    def call(self, row: Service, request: Any = None, deadline_s: float = DEADLINE_S) -> Any:
        """The response of a service. Raises AssertionError on timeout.

        The request is repeated after a while: a request sent to a killed server is lost, and DDS still lists a dead
        server for 20 s.
        """
        service = interface_class(row.type)
        client = self.node.create_client(service, row.name)
        futures: list[Any] = []
        ask_s = -math.inf

        def answer() -> Any:
            nonlocal ask_s
            if time.monotonic() >= ask_s:
                ask_s = time.monotonic() + _ASK_AGAIN_S
                futures.append(client.call_async(request if request is not None else service.Request()))
            return next((future for future in futures if future.done()), None)

        try:
            wait_for(client.service_is_ready, f"service {row.name}", deadline_s)
            return wait_for(answer, f"an answer of {row.name}", deadline_s).result()
        finally:
            self.node.destroy_client(client)

    def close(self) -> None:
        self._executor.stop()
        self._thread.join(5.0)
        self.node.destroy_node()
        self._executor.shutdown()
        rclpy.try_shutdown(context=self.context)
