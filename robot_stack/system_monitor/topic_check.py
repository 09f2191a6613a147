"""Compares the topics of the live graph with their rows in the contract: endpoints, types, QoS, rates and ages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from robot_stack.contract import topics
from robot_stack.contract.graph import Endpoints, lacking, strangers
from robot_stack.contract.model import EVERY_NODE, Durability, Reliability, System, Topic

_SUPERVISOR = "supervisor"


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A publisher or subscriber in the ROS graph, which does not contain the depth of its history."""

    node: str
    type: str
    reliability: Reliability
    durability: Durability


@dataclass(frozen=True, slots=True)
class Traffic:
    """What was received on a topic in a window.

    age_s: since the newest message; None if there never was one. rates_hz: the rate of each sender, where the messages
    contain their sender; else one rate for all.
    """

    count: int
    window_s: float
    age_s: float | None
    rates_hz: tuple[float, ...] = ()

    @property
    def rate_hz(self) -> float:
        return sum(self.rates_hz)


def message_rate_hz(count: int, first_s: float, last_s: float, window: tuple[float, float], period_s: float) -> float:
    """The rate of messages received in a window, all times in s of one clock; ``period_s`` is the nominal period.

    Between the first and the last message there are count - 1 periods, which is exact for slow topics too. If a sender
    began late or has fallen silent, the whole window counts.
    """
    begin_s, end_s = window
    whole = first_s - begin_s <= 1.5 * period_s and end_s - last_s <= 1.5 * period_s
    if whole and count > 1:
        return (count - 1) / (last_s - first_s)
    return count / (end_s - begin_s)


@dataclass(frozen=True, slots=True)
class Seen:
    """One topic of the live graph."""

    publishers: tuple[Endpoint, ...] = ()
    subscribers: tuple[Endpoint, ...] = ()
    traffic: Traffic = Traffic(0, 0.0, None)


class Verdict(Enum):
    OK = "ok"
    QUIET = "quiet"  # a topic for events, without one so far
    NOT_RUN = "not run"  # none of its publishers belongs to this profile
    WRONG = "wrong"


@dataclass(frozen=True, slots=True)
class Finding:
    row: Topic
    seen: Seen
    verdict: Verdict
    problems: tuple[str, ...]

    @property
    def expected_hz(self) -> float | None:
        """The row's rate, times its publishers."""
        return None if self.row.rate_hz is None else self.row.rate_hz * max(1, len(self.seen.publishers))

    @property
    def rate_error(self) -> float:
        """The greatest relative error of a sender's rate; 0 for a topic without a rate or a publisher."""
        expected_hz, rates_hz = self.expected_hz, self.seen.traffic.rates_hz
        if expected_hz is None or self.row.rate_hz is None or not self.seen.publishers or self.row.on_demand:
            return 0.0
        if len(rates_hz) == len(self.seen.publishers):
            return max(abs(rate_hz / self.row.rate_hz - 1.0) for rate_hz in rates_hz)
        return abs(self.seen.traffic.rate_hz / expected_hz - 1.0)


def rows_of(machine: System, use_sim_time: bool) -> tuple[Topic, ...]:
    """The rows of one machine and its simulation, those of every node, and those of the supervisor, which runs with
    every machine; /clock only if nodes use it.
    """
    own = topics.of_system(machine, System.SIMULATION)
    common = {EVERY_NODE, _SUPERVISOR}
    rows = (row for row in topics.TOPICS if row in own or common & {*row.publishers, *row.subscribers})
    return tuple(row for row in rows if use_sim_time or row is not topics.CLOCK)


def judge(row: Topic, seen: Seen, nodes: frozenset[str], tolerance: float) -> Finding:
    """One row against the graph.

    nodes: the nodes that should run. tolerance: allowed relative error of a rate.
    """
    endpoints = Endpoints(
        frozenset(endpoint.node for endpoint in seen.publishers),
        frozenset(endpoint.node for endpoint in seen.subscribers),
    )
    problems = [*_type_problems(row, seen), *_qos_problems(row, seen)]
    problems += [f"{stranger}, which the contract does not name" for stranger in strangers(row, endpoints, nodes)]
    problems += lacking(row, endpoints, nodes)
    finding = Finding(row, seen, Verdict.OK, ())
    if seen.publishers:
        problems += _traffic_problems(finding, tolerance)
    if problems:
        return Finding(row, seen, Verdict.WRONG, tuple(problems))
    if not seen.publishers:
        return Finding(row, seen, Verdict.NOT_RUN, ())
    quiet = (row.rate_hz is None or row.on_demand) and seen.traffic.age_s is None
    return Finding(row, seen, Verdict.QUIET if quiet else Verdict.OK, ())


def unknown_topics(names: Sequence[str], rows: Sequence[Topic]) -> tuple[str, ...]:
    """Topics of the graph that are not in the contract, except ROS's own."""
    known = {row.name for row in rows} | {"/rosout", "/parameter_events", topics.CLOCK.name}
    return tuple(sorted(name for name in names if name not in known and "/_action/" not in name))


def worst_rate_error(findings: Sequence[Finding]) -> tuple[float, str]:
    """The greatest relative error of a measured rate, and its topic; (0, "") without rates."""
    return max(
        ((finding.rate_error, finding.row.name) for finding in findings if finding.rate_error), default=(0.0, "")
    )


def _type_problems(row: Topic, seen: Seen) -> list[str]:
    found = {endpoint.type for endpoint in (*seen.publishers, *seen.subscribers)} - {row.type}
    return [f"type {name} in the graph" for name in sorted(found)]


def _qos_problems(row: Topic, seen: Seen) -> list[str]:
    wanted = (row.qos.reliability, row.qos.durability)
    return [
        f"{endpoint.node} publishes {endpoint.reliability.name}, {endpoint.durability.name}"
        for endpoint in seen.publishers
        if (endpoint.reliability, endpoint.durability) != wanted
    ]


def _traffic_problems(finding: Finding, tolerance: float) -> list[str]:
    expected_hz, traffic = finding.expected_hz, finding.seen.traffic
    if expected_hz is None or finding.row.on_demand:
        return []
    if traffic.age_s is None:
        return ["advertised, but nothing is sent"]
    stale_s = finding.row.stale_s
    if stale_s is not None and traffic.age_s > stale_s:
        return [f"silent for {traffic.age_s:.1f} s"]
    if finding.rate_error > tolerance:
        return [f"{traffic.rate_hz:.1f} Hz instead of {expected_hz:g}"]
    return []


def judge_all(
    rows: Sequence[Topic], seen: Mapping[str, Seen], nodes: frozenset[str], tolerance: float
) -> tuple[Finding, ...]:
    """Every row against the graph; ``seen`` may lack topics without endpoints."""
    return tuple(judge(row, seen.get(row.name, Seen()), nodes, tolerance) for row in rows)
