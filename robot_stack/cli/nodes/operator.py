"""The operator's node: publishes commands, receives answers, and calls services during one verb."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

from rclpy.duration import Duration
from rclpy.publisher import Publisher

from robot_stack.cli.errors import NoAnswer
from robot_stack.contract import topics
from robot_stack.contract.model import ContractViolation, Service, Topic
from robot_stack.middleware.emergency_stop import StopSource
from robot_stack.ros import transport
from robot_stack.ros.interfaces import interface_class, qos_profile
from robot_stack.ros.tool_node import ToolNode


class Operator:
    """A context manager. Callbacks run only inside ``wait``, in the caller's thread."""

    def __init__(self) -> None:
        transport.apply()
        self._tool = ToolNode(topics.OPERATOR_TOOL)
        self.node, self._executor = self._tool.node, self._tool.executor

    def __enter__(self) -> Operator:
        return self

    def __exit__(self, *_: object) -> None:
        self._tool.close()

    def advertise(self, row: Topic) -> Publisher:
        """Raises ContractViolation if the contract does not name operators as publishers of the row."""
        if topics.OPERATOR_TOOL not in row.publishers:
            raise ContractViolation(f"{topics.OPERATOR_TOOL} may not publish {row.name}")
        return self.node.create_publisher(interface_class(row.type), row.name, qos_profile(row.qos))

    def stop_source(self) -> tuple[StopSource, Publisher, Publisher]:
        """(this operator's source of the emergency stop, its publisher of the stop, its publisher of the reports)."""
        stop, sources = self.advertise(topics.EMERGENCY_STOP), self.advertise(topics.EMERGENCY_STOP_SOURCES)
        stamp = self.node.get_clock()
        return StopSource(topics.OPERATOR_TOOL, os.getpid(), stop, sources, lambda: stamp.now().to_msg()), stop, sources

    def subscribe(self, row: Topic, callback: Callable[[Any], None]) -> None:
        self.node.create_subscription(interface_class(row.type), row.name, callback, qos_profile(row.qos))

    def receive(self, row: Topic, timeout_s: float) -> Any:
        """The newest message of a row once there is one; None without one in time."""
        received: list[Any] = []
        self.subscribe(row, received.append)
        return received[-1] if self.wait(lambda: received, timeout_s) else None

    def wait(self, condition: Callable[[], Any], timeout_s: float | None) -> bool:
        """Runs callbacks until the condition holds (True) or the timeout expires (False); None waits forever."""
        end_s = float("inf") if timeout_s is None else time.monotonic() + timeout_s
        while not condition():
            remaining_s = end_s - time.monotonic()
            if remaining_s <= 0.0:
                return False
            self._executor.spin_once(min(remaining_s, 0.02))
        return True

    def deliver(self, publisher: Publisher, timeout_s: float) -> bool:
        """Waits for a subscriber, and until every subscriber has acknowledged all messages."""
        end_s = time.monotonic() + timeout_s
        if not self.wait(lambda: publisher.get_subscription_count() > 0, timeout_s):
            return False
        return bool(publisher.wait_for_all_acked(Duration(seconds=max(0.0, end_s - time.monotonic()))))

    def call(self, row: Service, timeout_s: float, **request: Any) -> Any:
        """Calls a service with the fields ``request`` and returns its response. Raises NoAnswer."""
        service = interface_class(row.type)
        client = self.node.create_client(service, row.name)
        try:
            if not self.wait(client.service_is_ready, timeout_s):
                raise NoAnswer(f"{row.name} has no server")
            future = client.call_async(service.Request(**request))
            if not self.wait(future.done, timeout_s):
                raise NoAnswer(f"{row.server} does not answer {row.name}")
            return future.result()
        finally:
            self.node.destroy_client(client)
