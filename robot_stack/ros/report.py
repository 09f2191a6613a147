"""What a node says about itself: the heartbeat and its entry in ``/diagnostics``."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from custom_msgs.msg import Heartbeat
from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.health import InputState

if TYPE_CHECKING:
    from robot_stack.ros.node import StackNode


@dataclass(slots=True)
class Loop:
    """Statistics of one timer since the last report: calls, worst duration, and calls longer than the period."""

    name: str
    period_s: float
    calls: int = 0
    worst_s: float = 0.0
    overruns: int = 0

    def timed(self, callback: Callable[[], None]) -> Callable[[], None]:
        def call() -> None:
            start_s = time.perf_counter()
            callback()
            taken_s = time.perf_counter() - start_s
            self.calls += 1
            self.worst_s = max(self.worst_s, taken_s)
            self.overruns += taken_s > self.period_s

        return call


class Report:
    """Publishes heartbeat and diagnostics of a node from the node's own loop, so that a hung node falls silent."""

    def __init__(self, node: StackNode) -> None:
        self._node = node
        self._heartbeat = node.advertise(topics.HEARTBEAT)
        self._diagnostics = node.advertise(topics.DIAGNOSTICS)
        self._sequence = 0
        self.ok = False
        self.text = "starting"
        self.values: dict[str, str] = {}
        self.loops: list[Loop] = []
        node.create_timer(1.0 / _rate_hz(topics.HEARTBEAT), self.beat)
        node.create_timer(1.0 / _rate_hz(topics.DIAGNOSTICS), self.diagnose)

    def beat(self) -> None:
        self._sequence += 1
        self._heartbeat.publish(
            Heartbeat(
                stamp=self._node.stamp(),
                node=self._node.get_name(),
                pid=os.getpid(),
                sequence=self._sequence % 2**32,
                ready=self.ok,
                waiting_for="" if self.ok else self.text,
            )
        )

    def diagnose(self) -> None:
        inputs = self._node.input_states()
        stale = [item.name for item in inputs.values() if item.received and not item.fresh]
        status = DiagnosticStatus(
            name=self._node.get_name(),
            hardware_id="robot_stack",
            level=DiagnosticStatus.OK if self.ok and not stale else DiagnosticStatus.WARN,
            message=self.text if not stale else f"{self.text}; stale: {', '.join(stale)}",
            values=[KeyValue(key=key, value=value) for key, value in self._values(inputs).items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.stamp()
        self._diagnostics.publish(message)

    def _values(self, inputs: dict[str, InputState]) -> dict[str, str]:
        values = dict(self.values)
        for item in inputs.values():
            values[f"input {item.name}"] = _describe_input(item)
        for loop in self.loops:
            values[f"loop {loop.name}"] = (
                f"{loop.calls} calls, worst {loop.worst_s * 1e3:.1f} ms of {loop.period_s * 1e3:.0f} ms, "
                f"{loop.overruns} overruns"
            )
            loop.calls, loop.worst_s, loop.overruns = 0, 0.0, 0
        return values


def _describe_input(item: InputState) -> str:
    if not item.received:
        return "nothing received"
    rate = "" if math.isnan(item.rate_hz) else f", {item.rate_hz:.1f} Hz"
    return f"{item.received} received{rate}, age {item.age_s:.2f} s{'' if item.fresh else ', STALE'}"


def _rate_hz(topic: Topic) -> float:
    assert topic.rate_hz is not None
    return topic.rate_hz
