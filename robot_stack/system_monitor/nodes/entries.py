"""The system monitor's own entries of /diagnostics: computer, processes, topics, graph and clock."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from diagnostic_msgs.msg import DiagnosticStatus

from robot_stack.contract import topics
from robot_stack.contract.graph import Endpoints, lacking, strangers
from robot_stack.contract.model import System
from robot_stack.system_monitor.clock import ClockWatch
from robot_stack.system_monitor.computer import ProcessFigures, describe, describe_process, hottest, together
from robot_stack.system_monitor.diagnostics_tree import Level
from robot_stack.system_monitor.nodes.computer_reader import ComputerReader, ProcessReader
from robot_stack.system_monitor.nodes.graph_reader import GraphReader
from robot_stack.system_monitor.nodes.messages import status
from robot_stack.system_monitor.params import SystemMonitorParams
from robot_stack.system_monitor.robot_status import Usage
from robot_stack.system_monitor.topic_health import TopicHealth, describe_topic, judge_topic, topics_of

_ROWS = topics.of_system(System.ROBOT, System.SIMULATION)


class Entries:
    """usage, zones: the node's last readings. system_s: the system clock."""

    def __init__(
        self,
        params: SystemMonitorParams,
        nodes: Sequence[str],
        computer: ComputerReader,
        graph: GraphReader,
        traffic: TopicHealth,
        processes: ProcessReader,
        system_s: Callable[[], float],
    ) -> None:
        self._params, self._nodes = params, frozenset(nodes)
        self._computer, self._graph, self._traffic = computer, graph, traffic
        self._process_reader, self._system_s = processes, system_s
        self._processes: list[ProcessFigures] = []
        self._clock = ClockWatch(params.clock_step_s)
        self._rows = topics_of(_ROWS, nodes)
        self._judged_graph = -1
        self._differences: list[tuple[str, str]] = []
        self.usage = Usage()
        self.zones: dict[str, float] = {}

    def read_processes(self) -> None:
        self._processes = self._process_reader.read()

    def read_pss(self) -> None:
        self._process_reader.read_pss()

    def entries(self, now_s: float) -> list[DiagnosticStatus]:
        return [
            self._computer_entry(),
            self._process_entry(),
            self._topic_entry(now_s),
            self._graph_entry(),
            self._clock_entry(now_s),
        ]

    def _computer_entry(self) -> DiagnosticStatus:
        zone, celsius = hottest(self.zones)
        usage = self.usage
        values = [
            ("cpu", describe(usage.cpu_percent, "%")),
            ("memory", describe(usage.memory_percent, "%")),
            ("disk", describe(usage.disk_percent, "%")),
            ("temperature", f"{describe(celsius, 'C')}{f' ({zone})' if zone else ''}"),
            *((f"pressure {name}", describe(value, "%")) for name, value in self._computer.pressure().items()),
            *((name, describe(value, "C")) for name, value in self.zones.items()),
        ]
        text = f"cpu {values[0][1]}, memory {values[1][1]}, disk {values[2][1]}, {values[3][1]}"
        return status("system_monitor: computer", Level.OK, text, values)

    def _process_entry(self) -> DiagnosticStatus:
        values = [(item.name, describe_process(item)) for item in self._processes]
        text = f"{len(values)} processes: {describe_process(together(self._processes))}"
        return status("system_monitor: processes", Level.OK, text, values)

    def _topic_entry(self, now_s: float) -> DiagnosticStatus:
        values, wrong = [], []
        for row in self._rows:
            figures = self._traffic.figures(row.name, now_s)
            problem = judge_topic(row, figures, self._nodes, self._params.rate_tolerance)
            values.append((row.name, f"{describe_topic(row, figures)}{f': {problem}' if problem else ''}"))
            if problem:
                wrong.append(f"{row.name} {problem}")
        return status("system_monitor: topics", _warning(wrong), "; ".join(wrong) or "as in the contract", values)

    def _graph_entry(self) -> DiagnosticStatus:
        """Cached while the graph has not changed."""
        if self._judged_graph != self._graph.version:
            self._judged_graph, self._differences = self._graph.version, self._judge_graph()
        wrong = [f"{name} {problem}" for name, problem in self._differences]
        text = "; ".join(wrong) or "as in the contract"
        return status("system_monitor: graph", _warning(wrong), text, self._differences)

    def _judge_graph(self) -> list[tuple[str, str]]:
        differences = []
        for row in _ROWS:
            seen = self._graph.endpoints.get(row.name, Endpoints())
            problems = (*lacking(row, seen, self._nodes), *strangers(row, seen, self._nodes))
            if problems:
                differences.append((row.name, "; ".join(problems)))
        return [*differences, *((name, "two nodes of this name") for name in self._graph.doubles)]

    def _clock_entry(self, now_s: float) -> DiagnosticStatus:
        state = self._clock.update(self._system_s(), now_s)
        values = [("offset", f"{state.offset_s:+.3f} s since the start"), ("steps", str(state.steps))]
        if state.steps:
            values.append(("last step", f"{state.last_step_s:+.3f} s"))
        far = abs(state.offset_s) > self._params.clock_drift_s
        text = f"the system clock has moved by {state.offset_s:+.3f} s, {state.steps} steps"
        return status("system_monitor: clock", Level.WARN if far else Level.OK, text, values)


def _warning(problems: Sequence[str]) -> Level:
    return Level.WARN if problems else Level.OK
