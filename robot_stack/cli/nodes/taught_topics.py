"""Receives the topics of a map from the running stack, as bytes, for ``robot-stack map teach``."""

from __future__ import annotations

from typing import Any, NamedTuple

from rclpy.serialization import deserialize_message

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.middleware.wire import READERS
from robot_stack.ros import transport
from robot_stack.ros.interfaces import interface_class, listener_profile
from robot_stack.ros.tool_node import ToolNode

NAME = "robot_stack_map_teach"
# A sweep arrives after the readings of its time.
ROWS = (topics.IMU, topics.LIDAR_POINTS, topics.ODOM)


class Taken(NamedTuple):
    """A received message. received_ns, sent_ns: system time; sent_ns is 0 if the middleware does not provide it."""

    row: Topic
    data: bytes
    received_ns: int
    sent_ns: int


class TaughtTopics:
    """A context manager. It publishes nothing."""

    def __init__(self) -> None:
        transport.apply(bulk=True)
        transport.keep_memory()
        self._tool = ToolNode(NAME)
        self._subscriptions: list[tuple[Topic, Any]] = [
            (
                row,
                self._tool.node.create_subscription(
                    interface_class(row.type), row.name, lambda _: None, listener_profile(row), raw=True
                ),
            )
            for row in ROWS
        ]

    def __enter__(self) -> TaughtTopics:
        return self

    def __exit__(self, *_: object) -> None:
        self._tool.close()

    def published(self) -> bool:
        """True if any of the topics has a publisher."""
        return any(self._tool.node.count_publishers(row.name) for row in ROWS)

    def take(self) -> list[Taken]:
        """All received messages, by topic. Without an executor, which would wake for every single message."""
        found = []
        for row, subscription in self._subscriptions:
            while (taken := subscription.handle.take_message(subscription.msg_type, True)) is not None:
                data, info = taken
                found.append(Taken(row, data, info["received_timestamp"], info["source_timestamp"]))
        return found


def decoded(row: Topic, data: bytes) -> Any:
    """An object with the fields of the row's type."""
    read = READERS.get(row.type)
    return read(data) if read is not None else deserialize_message(data, interface_class(row.type))
