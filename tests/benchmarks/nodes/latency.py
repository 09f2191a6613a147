"""Ages of stamped messages at their arrival, and the newest of each for a picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from robot_stack.contract.model import Topic
from robot_stack.middleware.conversions import time_to_s
from robot_stack.ros import transport
from robot_stack.ros.interfaces import interface_class, qos_profile
from robot_stack.ros.tool_node import ToolNode


class LatencyMeter:
    """Ages by stamp in s, on the ROS clock of the machine (system time). A context manager."""

    def __init__(self, rows: Sequence[Topic]) -> None:
        transport.apply(bulk=True)
        self._tool = ToolNode("latency_meter")
        self._node, self._executor = self._tool.node, self._tool.executor
        self.ages_s: dict[str, list[float]] = {row.name: [] for row in rows}
        self.latest: dict[str, Any] = {}
        for row in rows:
            profile = qos_profile(row.qos)
            self._node.create_subscription(interface_class(row.type), row.name, self._taker(row.name), profile)

    def __enter__(self) -> LatencyMeter:
        return self

    def __exit__(self, *_: object) -> None:
        self._tool.close()

    def run(self, duration_s: float) -> None:
        """Receives for ``duration_s``; earlier ages are cleared."""
        for ages in self.ages_s.values():
            ages.clear()
        clock = self._node.get_clock()
        end_s = clock.now().nanoseconds * 1e-9 + duration_s
        while clock.now().nanoseconds * 1e-9 < end_s:
            self._executor.spin_once(0.1)

    def _taker(self, name: str) -> Callable[[Any], None]:
        clock = self._node.get_clock()

        def take(message: Any) -> None:
            now_s = clock.now().nanoseconds * 1e-9
            self.ages_s[name].append(now_s - time_to_s(message.header.stamp))
            self.latest[name] = message

        return take
