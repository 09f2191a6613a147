"""Measures the traffic of all topics at once, cheaply: messages are counted, not unpacked."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from robot_stack.bench.graph import Endpoint, Seen, Traffic, message_rate_hz
from robot_stack.contract import topics
from robot_stack.contract.model import Durability, Reliability, Topic
from robot_stack.ros import transport
from robot_stack.ros.conversions import time_to_s
from robot_stack.ros.executor import LeanExecutor
from robot_stack.ros.interfaces import interface_class, qos_profile

NAME = "rate_meter"
# Longer than any pause of this process, at the highest rate of the robot's topics.
_DEPTH = 100
# Many nodes send these; their rates are those of each, and the messages tell whose they are.
_SENDERS: dict[str, Callable[[Any], str]] = {
    topics.HEARTBEAT.name: lambda message: str(message.node),
    topics.DIAGNOSTICS.name: lambda message: str(message.status[0].name) if message.status else "",
}
# It watches the others from outside and lives on the system clock, whatever clock they live on.
_ON_SYSTEM_CLOCK = "supervisor"


class Meter:
    """Listens to the rows' topics. A context manager; counts only while ``run`` runs.

    Where /clock is among the rows, rates and ages are those of simulated time.
    """

    def __init__(self, rows: Sequence[Topic]) -> None:
        transport.apply(bulk=True)
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
        self._rows = {row.name: row for row in rows}
        self._streams: dict[str, dict[str, _Stream]] = {row.name: {} for row in rows}
        self._last_s: dict[str, float] = {}
        self._window = (0.0, 0.0)
        self._clock: list[tuple[float, float]] = []  # (received, simulated) time of the first and last tick, s
        for row in rows:
            if row is topics.CLOCK:
                self._node.create_subscription(interface_class(row.type), row.name, self._on_clock, self._qos(row))
                continue
            sender = _SENDERS.get(row.name)
            callback = self._counter(row.name, sender or (lambda _: ""))
            self._node.create_subscription(
                interface_class(row.type), row.name, callback, self._qos(row), raw=sender is None
            )

    @staticmethod
    def _qos(row: Topic) -> QoSProfile:
        """The row's, but deep enough to lose nothing while this process waits for the processor."""
        profile = qos_profile(row.qos)
        profile.depth = max(profile.depth, _DEPTH)
        return profile

    def __enter__(self) -> Meter:
        return self

    def __exit__(self, *_: object) -> None:
        self._node.destroy_node()
        self._executor.shutdown()
        rclpy.try_shutdown(context=self._context)

    def _counter(self, name: str, sender: Callable[[Any], str]) -> Callable[[Any], None]:
        streams = self._streams[name]

        def on_message(message: Any) -> None:
            now_s = time.monotonic()
            self._last_s[name] = now_s
            streams.setdefault(sender(message), _Stream(now_s)).add(now_s)

        return on_message

    def _on_clock(self, message: Any) -> None:
        now_s = time.monotonic()
        self._last_s[topics.CLOCK.name] = now_s
        self._streams[topics.CLOCK.name].setdefault("", _Stream(now_s)).add(now_s)
        self._clock[1:] = [(now_s, time_to_s(message.clock))]

    def speed(self) -> float:
        """Simulated over real time in the last ``run``; 1 where nodes live on the system clock."""
        if len(self._clock) < 2:
            return 1.0
        (first_s, begin_s), (last_s, end_s) = self._clock
        return (end_s - begin_s) / (last_s - first_s) if last_s > first_s else 1.0

    def settle(self, longest_s: float = 5.0) -> None:
        """Waits until the graph no longer changes and everything that has a rate arrives: discovery takes its time."""
        end_s = time.monotonic() + longest_s
        before: dict[str, int] = {}
        while time.monotonic() < end_s:
            self.run(0.5)
            publishers = {name: self._node.count_publishers(name) for name in self._rows}
            silent = [
                name
                for name, count in publishers.items()
                if count and self._rows[name].rate_hz is not None and name not in self._last_s
            ]
            if publishers == before and not silent:
                return
            before = publishers

    def run(self, duration_s: float) -> None:
        """Counts for so long, from zero. What arrived in between is not counted, but its age is known."""
        self._drain()
        for streams in self._streams.values():
            streams.clear()
        self._clock.clear()
        begun_s = time.monotonic()
        while time.monotonic() - begun_s < duration_s:
            self._executor.spin_once(0.1)
        self._window = (begun_s, time.monotonic())

    def _drain(self) -> None:
        """Takes what has waited since the last run."""
        for _ in range(3):
            self._executor.spin_once(0.0)

    def seen(self) -> dict[str, Seen]:
        """Every measured topic as the graph and the last ``run`` showed it."""
        now_s = time.monotonic()
        return {name: self._see(name, now_s) for name in self._rows}

    def topic_names(self) -> list[str]:
        """All topics of the graph that somebody publishes."""
        return [name for name, _ in self._node.get_topic_names_and_types() if self._node.count_publishers(name)]

    def _see(self, name: str, now_s: float) -> Seen:
        last_s = self._last_s.get(name)
        age_s = None if last_s is None else (now_s - last_s) * self.speed()
        return Seen(
            publishers=tuple(_endpoint(item) for item in self._node.get_publishers_info_by_topic(name)),
            subscribers=tuple(
                _endpoint(item) for item in self._node.get_subscriptions_info_by_topic(name) if item.node_name != NAME
            ),
            traffic=self._traffic(name, age_s),
        )

    def _traffic(self, name: str, age_s: float | None) -> Traffic:
        streams, window, speed = self._streams[name], self._window, self.speed()
        rate_hz = self._rows[name].rate_hz
        rates_hz = []
        for sender, item in streams.items():
            scale = 1.0 if sender == _ON_SYSTEM_CLOCK else speed
            # Without a nominal rate every gap at the ends counts.
            period_s = 0.0 if rate_hz is None else 1.0 / (rate_hz * scale)
            rates_hz.append(message_rate_hz(item.count, item.first_s, item.last_s, window, period_s) / scale)
        return Traffic(sum(item.count for item in streams.values()), window[1] - window[0], age_s, tuple(rates_hz))


class _Stream:
    """The messages of one sender on one topic."""

    __slots__ = ("count", "first_s", "last_s")

    def __init__(self, first_s: float) -> None:
        self.count = 0
        self.first_s = self.last_s = first_s

    def add(self, now_s: float) -> None:
        self.count += 1
        self.last_s = now_s


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
