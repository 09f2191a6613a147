"""A node's reports: its record on this machine, the heartbeat topic, its entry in ``/diagnostics``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from custom_msgs.msg import Heartbeat
from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.contract.processes import HEARTBEAT_HZ
from robot_stack.core.health import INPUT_PREFIX, InputState, describe_input
from robot_stack.middleware.port import Port, Publisher

# A simulated world detects a late node by its timers. A node without timers reads the clock at this period.
_LOOK_S = 0.05


@dataclass(slots=True)
class Loop:
    """Statistics of one timer since the last report: calls, worst duration, and calls longer than the period."""

    name: str
    period_s: float
    calls: int = 0
    worst_s: float = 0.0
    overruns: int = 0

    def timed(self, callback: Callable[[], None], clock_s: Callable[[], float]) -> Callable[[], None]:
        def call() -> None:
            start_s = clock_s()
            callback()
            taken_s = clock_s() - start_s
            self.calls += 1
            self.worst_s = max(self.worst_s, taken_s)
            self.overruns += taken_s > self.period_s

        return call


class ReportingNode(Protocol):
    """The part of a node that a report uses."""

    port: Port

    def advertise(self, row: Topic) -> Publisher: ...
    def every_real(self, rate_hz: float, callback: Callable[[], None]) -> None: ...
    def input_states(self) -> dict[str, InputState]: ...
    def stamp(self) -> Any: ...


class Report:
    """Reports from the node's own loop, so that a hung node stops reporting."""

    def __init__(self, node: ReportingNode) -> None:
        self._node = node
        self._heartbeat = node.advertise(topics.HEARTBEAT)
        self._diagnostics = node.advertise(topics.DIAGNOSTICS)
        self._sequence = 0
        self.ok = False
        self.text = "starting"
        self.values: dict[str, str] = {}
        self.loops: list[Loop] = []
        # Additional entries of a node that reports on more than itself, made when they are due.
        self.more: Callable[[], Sequence[DiagnosticStatus]] = tuple
        node.every_real(HEARTBEAT_HZ, self.beat)
        if node.port.simulated_time:  # a world faster than real time measures silence by its own time
            node.port.add_timer(1.0 / HEARTBEAT_HZ, self.beat)
            node.port.add_timer(_LOOK_S, lambda: None)
        node.every_real(topics.HEARTBEAT.nominal_rate_hz, self.publish_heartbeat)
        node.every_real(topics.DIAGNOSTICS.nominal_rate_hz, self.diagnose)

    def beat(self) -> None:
        self._node.port.node_record.beat(self.ok, self.text)
        self._node.port.follow_clock()

    def publish_heartbeat(self) -> None:
        """For receivers on other machines."""
        self._sequence += 1
        self._heartbeat.publish(
            Heartbeat(
                stamp=self._node.stamp(),
                node=self._node.port.name,
                pid=self._node.port.process_id,
                sequence=self._sequence % 2**32,
                ready=self.ok,
                waiting_for="" if self.ok else self.text,
            )
        )

    def diagnose(self) -> None:
        inputs = self._node.input_states()
        stale = [item.name for item in inputs.values() if item.received and not item.fresh]
        status = diagnostic_status(
            self._node.port.name,
            DiagnosticStatus.OK if self.ok and not stale else DiagnosticStatus.WARN,
            self.text if not stale else f"{self.text}; stale: {', '.join(stale)}",
            self._values(inputs).items(),
        )
        message = DiagnosticArray(status=[status, *self.more()])
        message.header.stamp = self._node.stamp()
        self._diagnostics.publish(message)

    def _values(self, inputs: dict[str, InputState]) -> dict[str, str]:
        values = {**self._node.port.report_values(), **self.values}
        for item in inputs.values():
            values[f"{INPUT_PREFIX}{item.name}"] = describe_input(item)
        for loop in self.loops:
            values[f"loop {loop.name}"] = (
                f"{loop.calls} calls, worst {loop.worst_s * 1e3:.1f} ms of {loop.period_s * 1e3:.0f} ms, "
                f"{loop.overruns} overruns"
            )
            loop.calls, loop.worst_s, loop.overruns = 0, 0.0, 0
        return values


def diagnostic_status(name: str, level: bytes, message: str, values: Iterable[tuple[str, str]]) -> DiagnosticStatus:
    """An entry of this stack in ``/diagnostics``."""
    return DiagnosticStatus(
        name=name,
        hardware_id="robot_stack",
        level=level,
        message=message,
        values=[KeyValue(key=key, value=value) for key, value in values],
    )
