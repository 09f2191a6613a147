"""Measures the traffic of all topics at once, cheaply: messages are counted, not unpacked."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from robot_stack.bench.graph import Endpoint, Seen, Traffic
from robot_stack.contract.model import Durability, Reliability, Topic
from robot_stack.ros import transport
from robot_stack.ros.executor import LeanExecutor
from robot_stack.ros.interfaces import interface_class, qos_profile

NAME = "rate_meter"


class Meter:
    """Listens to the rows' topics. A context manager; counts only while ``run`` runs."""

    def __init__(self, rows: Sequence[Topic]) -> None:
        transport.apply()
        self._context = Context()
        rclpy.init(args=[], context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node(
            NAME,
            context=self._context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor = LeanExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._counts = {row.name: 0 for row in rows}
        self._last_s: dict[str, float] = {}
        self._window_s = 0.0
        for row in rows:
            self._node.create_subscription(
                interface_class(row.type), row.name, self._counter(row.name), qos_profile(row.qos), raw=True
            )

    def __enter__(self) -> Meter:
        return self

    def __exit__(self, *_: object) -> None:
        self._node.destroy_node()
        self._executor.shutdown()
        rclpy.try_shutdown(context=self._context)

    def _counter(self, name: str) -> Callable[[bytes], None]:
        def on_message(_: bytes) -> None:
            self._counts[name] += 1
            self._last_s[name] = time.monotonic()

        return on_message

    def run(self, duration_s: float) -> None:
        """Counts for so long, from zero. What arrived in between is not counted, but its age is known."""
        self._drain()
        for name in self._counts:
            self._counts[name] = 0
        begun_s = time.monotonic()
        while time.monotonic() - begun_s < duration_s:
            self._executor.spin_once(0.1)
        self._window_s = time.monotonic() - begun_s

    def _drain(self) -> None:
        """Takes what has waited since the last run."""
        for _ in range(3):
            self._executor.spin_once(0.0)

    def seen(self) -> dict[str, Seen]:
        """Every measured topic as the graph and the last ``run`` showed it."""
        now_s = time.monotonic()
        return {name: self._see(name, now_s) for name in self._counts}

    def topic_names(self) -> list[str]:
        """All topics of the graph that somebody publishes."""
        return [name for name, _ in self._node.get_topic_names_and_types() if self._node.count_publishers(name)]

    def _see(self, name: str, now_s: float) -> Seen:
        last_s = self._last_s.get(name)
        age_s = None if last_s is None else now_s - last_s
        return Seen(
            publishers=tuple(_endpoint(item) for item in self._node.get_publishers_info_by_topic(name)),
            subscribers=tuple(
                _endpoint(item) for item in self._node.get_subscriptions_info_by_topic(name) if item.node_name != NAME
            ),
            traffic=Traffic(self._counts[name], self._window_s, age_s),
        )


def _endpoint(info: Any) -> Endpoint:
    qos = info.qos_profile
    reliable = qos.reliability == ReliabilityPolicy.RELIABLE
    latched = qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
    return Endpoint(
        node=info.node_name,
        type=info.topic_type,
        reliability=Reliability.RELIABLE if reliable else Reliability.BEST_EFFORT,
        durability=Durability.TRANSIENT_LOCAL if latched else Durability.VOLATILE,
    )
