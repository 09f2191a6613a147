"""Runs one node of a recording alone on the scheduler and compares its outputs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.contract.processes import BY_NAME
from robot_stack.core.config import load
from robot_stack.middleware.port import Port, Publisher, open_port
from sim.replay.compare import Comparison, Timed, compare
from sim.replay.nodes import (
    NOT_COMPARED,
    REPLAYED,
    incomplete_inputs,
    inputs_of,
    is_own,
    outputs_of,
    reason_not_replayed,
)
from sim.replay.params import ReplayParams
from sim.replay.recorded import Recorded
from sim.scheduler.decoding import decoder
from sim.scheduler.events import NANOSECONDS
from sim.scheduler.observers import Observer
from sim.scheduler.params import NamedSpreads, SchedulerParams, Spread, WorkerParams, WorkerSpread
from sim.scheduler.scheduler import Scheduler
from sim.stack.stack import node_factories

# Virtual time before the first recorded message: the source of the inputs starts in it, and nodes that began to start
# before their first message.
_LEAD_NS: Final = 3 * NANOSECONDS
# The least duration of the scheduler's streams.
_INSTANT: Final = Spread(median_ms=0.001, p99_ms=0.001)
_INSTANT_NS: Final = 1_000
# Timers of all rates of a node coincide at whole seconds after its start.
_WHOLE_NS: Final = NANOSECONDS
_SOURCE: Final = "replay"
_SOURCE_S: Final = 0.5


@dataclass(frozen=True, slots=True)
class Row:
    """One output of a replayed node. skipped: why it is not compared; then there is no comparison."""

    topic: str
    comparison: Comparison | None
    skipped: str = ""


@dataclass(frozen=True, slots=True)
class NodeResult:
    """not_replayed: the reason, empty for a node that was. begin_s, end_s: of the comparison, from the recording's
    begin. failures: tracebacks of the node.
    """

    node: str
    not_replayed: str = ""
    rows: tuple[Row, ...] = ()
    begin_s: float = 0.0
    end_s: float = 0.0
    notes: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()

    @property
    def compared(self) -> bool:
        return any(row.comparison is not None and row.comparison.messages for row in self.rows)

    @property
    def equal(self) -> bool:
        return not self.failures and all(row.comparison is None or row.comparison.equal for row in self.rows)


@dataclass(frozen=True, slots=True)
class Life:
    """One life of a node in a recording, ns on the ROS clock. recorded_start: the node started during the recording, or
    within a second before; else ``start_ns`` is the earliest time from the recording's begin on at which its timers are
    in phase. restarted: it ends with a restart.
    """

    start_ns: int
    end_ns: int
    recorded_start: bool
    restarted: bool


class _Source:
    """Publishes the recorded inputs at their recorded times."""

    def __init__(self) -> None:
        self.port: Port = open_port(_SOURCE)

    def publishers(self, rows: Sequence[Topic]) -> dict[str, Publisher]:
        return {row.name: self.port.advertise(row, row.name) for row in rows}

    def safe_output(self) -> None:
        """A recording goes on to its end."""

    def destroy_node(self) -> None:
        self.port.close()


@dataclass(slots=True)
class _Outputs(Observer):
    """Messages of one node by topic, with the ROS time in s at which they left. until_ns: of virtual time."""

    node: str
    clock_start_ns: int
    found: dict[str, list[tuple[float, bytes]]] = field(default_factory=lambda: defaultdict(list))

    def on_publish(self, time_ns: int, node: str, topic: str, data: bytes) -> None:
        if node == self.node:
            self.found[topic].append((1e-9 * (self.clock_start_ns + time_ns), data))


def replay(
    node: str, recorded: Recorded, parameters: Mapping[str, Mapping[str, Any]], params: ReplayParams
) -> NodeResult:
    """parameters: overrides by node and name. Raises ConfigError for a configuration that the node refuses."""
    if node not in REPLAYED:
        return NodeResult(node, reason_not_replayed(node))
    life = life_of(node, recorded)
    if life is None:
        return NodeResult(node, "no heartbeat of it is recorded: it did not run, or /system/heartbeat was left out")
    missing = incomplete_inputs(node, recorded)
    if missing:
        return NodeResult(node, "; ".join(missing))
    if calls := REPLAYED[node].calls(recorded):
        return NodeResult(node, calls)
    found, failures = _run(node, recorded, life, parameters)
    begin_ns = max(life.start_ns, recorded.begin_ns) + round(params.settle_s * NANOSECONDS)
    window_s = 1e-9 * begin_ns, 1e-9 * life.end_ns
    outputs = [row for row in outputs_of(node) if row not in NOT_COMPARED]
    rows = tuple(_row(row, node, recorded, found, life, window_s, params) for row in outputs)
    notes = ["it was restarted: compared up to its last heartbeat before"] if life.restarted else []
    since_s = 1e-9 * recorded.begin_ns
    return NodeResult(node, "", rows, window_s[0] - since_s, window_s[1] - since_s, tuple(notes), tuple(failures))


def life_of(node: str, recorded: Recorded) -> Life | None:
    """The first life of a node in a recording, by its heartbeats; None without any."""
    read = decoder(topics.HEARTBEAT.type)
    beats = [beat for item in recorded.of(topics.HEARTBEAT) if (beat := read(item.data)).node == node]
    if not beats:
        return None
    own = [beat for beat in beats if beat.pid == beats[0].pid]
    starts = [_ns(beat.stamp) - beat.sequence * _WHOLE_NS for beat in own]
    period_ns, phase_ns = _phase(node, recorded, starts)
    start_ns = min(starts)
    start_ns += _nearest((phase_ns - start_ns) % period_ns, period_ns)
    recorded_start = own[0].sequence == 1  # the first heartbeat comes a second after the start
    if not recorded_start:
        start_ns = recorded.begin_ns + (start_ns - recorded.begin_ns) % period_ns
    restarted = len(own) < len(beats)
    return Life(start_ns, _ns(own[-1].stamp) if restarted else recorded.end_ns, recorded_start, restarted)


def _phase(node: str, recorded: Recorded, starts: Sequence[int]) -> tuple[int, int]:
    """(period, phase) in ns of the node's timers: by its heartbeats or by an output, whichever scatter less.

    In simulated time, heartbeats are on the computer's clock and show nothing. starts: of the node by each heartbeat.
    """
    by_beats, scatter_ns = _earliest(starts, _WHOLE_NS)
    row = REPLAYED[node].clock
    items = recorded.of(row) if row is not None else []
    if row is not None and items:
        read, period_ns = decoder(row.type), round(NANOSECONDS / row.nominal_rate_hz)
        headers = [(item.sent_ns, getattr(read(item.data), "header", None)) for item in items]
        times = [sent_ns if header is None else _ns(header.stamp) for sent_ns, header in headers]
        by_output, others_ns = _earliest(times, period_ns)
        if others_ns < scatter_ns:
            return period_ns, by_output
    return _WHOLE_NS, by_beats


def _earliest(times_ns: Sequence[int], period_ns: int) -> tuple[int, int]:
    """(phase, scatter) of periodic times that may be late, never early: the shortest arc with half of them."""
    phases = sorted(time_ns % period_ns for time_ns in times_ns)
    turned, half = [*phases, *(phase + period_ns for phase in phases)], (len(phases) + 1) // 2
    begin = min(range(len(phases)), key=lambda index: turned[index + half - 1] - turned[index])
    return phases[begin], turned[begin + half - 1] - turned[begin]


def _nearest(ahead_ns: int, period_ns: int) -> int:
    return ahead_ns if 2 * ahead_ns <= period_ns else ahead_ns - period_ns


def _run(
    node: str, recorded: Recorded, life: Life, parameters: Mapping[str, Mapping[str, Any]]
) -> tuple[dict[str, list[tuple[float, bytes]]], list[str]]:
    """Outputs of the node by topic, and its failures."""
    scheduled = load(SchedulerParams, "scheduler")
    clock_start_ns = recorded.begin_ns - _LEAD_NS
    exact = _exact(scheduled, jobs_known=recorded.seed is not None)
    with Scheduler(recorded.seed or 0, exact, clock_start_ns=clock_start_ns) as scheduler:
        outputs = _Outputs(node, clock_start_ns)
        scheduler.add_observer(outputs)
        source = scheduler.spawn(_SOURCE, _Source)
        scheduler.run(_SOURCE_S)
        rows = inputs_of(node)
        publishers = source.nodes[0].publishers(rows)  # type: ignore[attr-defined]
        latency_ns = None if recorded.times_of_reception else scheduled
        for row in rows:
            publish = publishers[row.name].publish
            for item in recorded.of(row):
                at_ns = item.received_ns - clock_start_ns - _INSTANT_NS + _latency_ns(row, latency_ns)
                scheduler.at(at_ns, publish, item.data)
        start_ns = life.start_ns - clock_start_ns - _INSTANT_NS
        scheduler.spawn(node, *node_factories(BY_NAME[node]), at_s=start_ns / NANOSECONDS, parameters=parameters)
        scheduler.run((life.end_ns - clock_start_ns) / NANOSECONDS)
        return outputs.found, [item.text for item in scheduler.failures]


def _latency_ns(row: Topic, scheduled: SchedulerParams | None) -> int:
    """From departure to arrival, where the recording has only the departure: the median of the scheduler's."""
    if scheduled is None:
        return 0
    latency = scheduled.latency
    spread = latency.rows.get(row.name) or (latency.bulk if row.bulk else latency.small)
    return round(spread.median_ms * 1e6)


def _exact(params: SchedulerParams, *, jobs_known: bool) -> SchedulerParams:
    """Without random durations: inputs arrive when they are published, computing takes its median.

    jobs_known: the seed is that of the run, so that the jobs of workers take as long as in it.
    """
    latency = params.latency.model_copy(update={"small": _INSTANT, "bulk": _INSTANT, "rows": {}})
    discovery = params.discovery.model_copy(update={"appear": _INSTANT})
    instant, compute = NamedSpreads(default=_INSTANT, names={}), params.compute
    compute = NamedSpreads(
        default=_median(params.compute.default),
        names={key: _median(item) for key, item in params.compute.names.items()},
    )
    workers = params.workers
    if not jobs_known:
        workers = WorkerParams(
            default=_worker_median(workers.default),
            names={key: _worker_median(item) for key, item in workers.names.items()},
        )
    return SchedulerParams(
        latency=latency, discovery=discovery, start=instant, construction=instant, compute=compute, workers=workers
    )


def _median(spread: Spread) -> Spread:
    return Spread(median_ms=spread.median_ms, p99_ms=spread.median_ms)


def _worker_median(spread: WorkerSpread) -> WorkerSpread:
    return spread.model_copy(update={"p99_ms": spread.median_ms})


def _row(
    row: Topic,
    node: str,
    recorded: Recorded,
    found: Mapping[str, list[tuple[float, bytes]]],
    life: Life,
    window_s: tuple[float, float],
    params: ReplayParams,
) -> Row:
    if row.name in recorded.changed:
        return Row(row.name, None, recorded.changed[row.name])
    if row.name not in recorded.topics:
        return Row(row.name, None, "not recorded")
    if row in REPLAYED[node].integrates and not life.recorded_start:
        return Row(row.name, None, "depends on everything since the node's start, which is not recorded")
    tolerance = params.of(row.name)
    read = decoder(row.type)
    begin_s, end_s = window_s[0], window_s[1] - tolerance.time_s

    def timed(at_s: float, data: bytes) -> Timed | None:
        message = read(data)
        return Timed(at_s, message) if is_own(row, node, message) else None

    mine = [timed(1e-9 * item.sent_ns, item.data) for item in recorded.of(row)]
    others = [timed(at_s, data) for at_s, data in found.get(row.name, [])]
    sides = [sorted((item for item in side if item is not None), key=lambda item: item.at_s) for side in (mine, others)]
    return Row(row.name, compare(sides[0], sides[1], tolerance, begin_s, end_s))


def _ns(stamp: Any) -> int:
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)
