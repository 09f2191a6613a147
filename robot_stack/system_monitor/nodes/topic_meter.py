"""A tool node that measures the traffic of all topics at low cost: messages are counted, not unpacked."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from robot_stack.contract import topics
from robot_stack.contract.model import Durability, Reliability, Topic
from robot_stack.middleware.conversions import time_to_s
from robot_stack.ros import transport
from robot_stack.ros.bulk import owner_of
from robot_stack.ros.interfaces import interface_class, qos_profile
from robot_stack.ros.tool_node import ToolNode
from robot_stack.system_monitor.topic_check import Endpoint, Seen, Traffic, message_rate_hz

NAME = "rate_meter"
# Messages wait in their queues until taken; they carry their time of reception.
_TAKE_EVERY_S = 0.1
_DEPTH_S = 1.0
_LEAST_DEPTH = 50
# Clouds and images must be taken before their shared memory is reused.
_BULK_DEPTH = 5
# Many nodes send these; rates are per sender, which the messages contain. They are signs of life and keep their rate
# in real time where simulated time is slow.
_SENDERS: dict[str, Callable[[Any], str]] = {
    topics.HEARTBEAT.name: lambda message: str(message.node),
    topics.DIAGNOSTICS.name: lambda message: str(message.status[0].name) if message.status else "",
}


@dataclass(slots=True)
class _Input:
    """One subscription, and its traffic in a window, by sender. unpack: the sender is in the message.

    last_s, taken_s: system time of the newest message and of the last take.
    """

    subscription: Any
    sender: Callable[[Any], str]
    unpack: bool
    streams: dict[str, _Stream]
    last_s: float | None = None
    taken_s: float = 0.0

    def take(self) -> None:
        self.taken_s = time.time()
        handle, kind = self.subscription.handle, self.subscription.msg_type
        while (taken := handle.take_message(kind, not self.unpack)) is not None:
            message, info = taken
            self.last_s = received_s = 1e-9 * info["received_timestamp"]
            self.streams.setdefault(self.sender(message), _Stream(received_s)).add(received_s)


class Meter:
    """Subscribes to the rows' topics. A context manager; counts only during ``run``.

    Rates and ages are in simulated time if the stack uses it.
    """

    def __init__(self, rows: Sequence[Topic]) -> None:
        transport.apply(bulk=True)
        self._tool = ToolNode(NAME)
        self._node = self._tool.node
        self._rows = {row.name: row for row in rows}
        self._clock_s: list[float] = []  # of the first and the last tick of a window
        self._inputs = {row.name: self._listen(row) for row in rows}
        self._window = (0.0, 0.0)
        self._speed = 1.0
        self.cpu_pct = 0.0

    def _listen(self, row: Topic) -> _Input:
        senders = {**_SENDERS, topics.CLOCK.name: self._on_clock}
        unpack = row.name in senders
        subscription = self._node.create_subscription(
            interface_class(row.type), row.name, lambda _: None, _qos(row), raw=not unpack
        )
        return _Input(subscription, senders.get(row.name, lambda _: ""), unpack, {})

    def _on_clock(self, message: Any) -> str:
        self._clock_s[1:] = [time_to_s(message.clock)]
        return ""

    def __enter__(self) -> Meter:
        return self

    def __exit__(self, *_: object) -> None:
        self._tool.close()

    def speed(self) -> float:
        """Simulated over real time in the last ``run``; 1 if nodes use the system clock."""
        return self._speed

    def settle(self, longest_s: float = 5.0) -> None:
        """Waits until discovery ends: the graph no longer changes, and every topic with a rate has arrived."""
        end_s = time.monotonic() + longest_s
        before: dict[str, int] = {}
        while time.monotonic() < end_s:
            self.run(0.5)
            publishers = {name: self._node.count_publishers(name) for name in self._rows}
            silent = [
                name
                for name, count in publishers.items()
                if count and self._rows[name].rate_hz is not None and self._inputs[name].last_s is None
            ]
            if publishers == before and not silent:
                return
            before = publishers

    def run(self, duration_s: float) -> None:
        """Counts for ``duration_s``, from zero. Messages between two runs only update the age."""
        self._take()
        for item in self._inputs.values():
            item.streams.clear()
        self._clock_s.clear()
        begun_s, cpu_s = time.time(), time.process_time()
        while (remaining_s := begun_s + duration_s - time.time()) > 0.0:
            time.sleep(min(remaining_s, _TAKE_EVERY_S))
            self._take()
        ended_s = time.time()
        self._window = (begun_s, ended_s)
        self.cpu_pct = 100.0 * (time.process_time() - cpu_s) / (ended_s - begun_s)
        self._speed = self._measured_speed()

    def _measured_speed(self) -> float:
        ticks = self._inputs[topics.CLOCK.name].streams.get("") if topics.CLOCK.name in self._inputs else None
        if ticks is None or len(self._clock_s) < 2 or ticks.last_s <= ticks.first_s:
            return 1.0
        return (self._clock_s[-1] - self._clock_s[0]) / (ticks.last_s - ticks.first_s)

    def _take(self) -> None:
        for item in self._inputs.values():
            item.take()

    def seen(self) -> dict[str, Seen]:
        """Every measured topic with its endpoints and the traffic of the last ``run``."""
        return {name: self._see(name) for name in self._rows}

    def topic_names(self) -> list[str]:
        """All topics of the graph with a publisher."""
        return [name for name, _ in self._node.get_topic_names_and_types() if self._node.count_publishers(name)]

    def _see(self, name: str) -> Seen:
        entry = self._inputs[name]
        # Relative to the last take: newer messages may wait if the meter was delayed.
        age_s = None if entry.last_s is None else max(0.0, entry.taken_s - entry.last_s) * self._scale(name)
        return Seen(
            publishers=tuple(_endpoint(item) for item in self._node.get_publishers_info_by_topic(name)),
            subscribers=tuple(
                _endpoint(item) for item in self._node.get_subscriptions_info_by_topic(name) if item.node_name != NAME
            ),
            traffic=self._traffic(name, age_s),
        )

    def _traffic(self, name: str, age_s: float | None) -> Traffic:
        streams, window, scale = self._inputs[name].streams, self._window, self._scale(name)
        rate_hz = self._rows[name].rate_hz
        # Without a nominal rate, or with paused time, every gap at the ends counts.
        period_s = 0.0 if rate_hz is None or not scale else 1.0 / (rate_hz * scale)
        rates_hz = [
            message_rate_hz(item.count, item.first_s, item.last_s, window, period_s) / (scale or 1.0)
            for item in streams.values()
        ]
        return Traffic(sum(item.count for item in streams.values()), window[1] - window[0], age_s, tuple(rates_hz))

    def _scale(self, name: str) -> float:
        return 1.0 if name in _SENDERS else self._speed


class _Stream:
    """The messages of one sender on one topic."""

    __slots__ = ("count", "first_s", "last_s")

    def __init__(self, first_s: float) -> None:
        self.count = 0
        self.first_s = self.last_s = first_s

    def add(self, now_s: float) -> None:
        self.count += 1
        self.last_s = now_s


def _qos(row: Topic) -> QoSProfile:
    """The row's QoS, deep enough to lose nothing until the next take."""
    profile = qos_profile(row.qos)
    deep = _BULK_DEPTH if row.bulk else max(_LEAST_DEPTH, round(_DEPTH_S * (row.rate_hz or 0.0)))
    profile.depth = max(profile.depth, deep)
    return profile


def _endpoint(info: Any) -> Endpoint:
    qos = info.qos_profile
    reliable = qos.reliability == ReliabilityPolicy.RELIABLE
    latched = qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
    return Endpoint(
        node=owner_of(info.node_name),
        type=info.topic_type,
        reliability=Reliability.RELIABLE if reliable else Reliability.BEST_EFFORT,
        durability=Durability.TRANSIENT_LOCAL if latched else Durability.VOLATILE,
    )
