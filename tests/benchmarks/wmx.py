"""Joint states of the manipulator: rate, jitter and cost of the node, status reads, cycles of the simulated engine."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.config import load
from robot_stack.supervisor.params import SupervisorParams
from robot_stack.wmx import connect
from tests.benchmarks.support.framework import Aim, Result, percentile
from tests.benchmarks.support.own_engine import Processes, own_environment
from tests.benchmarks.support.stack import ProcessLoad, cpu_pct, pss_mb

if TYPE_CHECKING:
    from tests.benchmarks.nodes.joint_listener import JointListener

AIMS = {
    "joint_states_hz_off": Aim("<=", 1.0),
    "period_jitter_ms_p99": Aim("<", 0.5),
    "cpu_pct": Aim("<", 6.0),
    "status_read_us_p50": Aim("<", 20.0),
    "engine_cycle_jitter_us_p99": Aim("<", 20.0),
}
_NODE = "robot_stack.ros.main", "manipulator_state"
_ENGINE = "tests.benchmarks.support.wmx_engine"
_PLAIN = ("tests.benchmarks.nodes.plain_joint_states",)
_SETTLE = 1000  # messages before anything is measured
_READS = 1000
_READ_PAUSE_S = 0.002
_WARM_S = 3.0  # the first cycles run with cold caches, and the engine adapts its wake-up time


@dataclass(frozen=True, slots=True)
class Measured:
    """One publisher in one window of time. Jitter: deviation of a period from the nominal one."""

    rate_hz: float
    period_jitter_ms: list[float]
    arrival_jitter_ms: list[float]
    cpu_pct: float
    lost: int
    pss_mb: float
    window_ns: tuple[int, int]


@dataclass(frozen=True, slots=True)
class EngineMeasured:
    """The engine's process in one window of time. late_us: delay of its cycles after their deadlines."""

    cpu_pct: float
    late_us: list[float]


def run(
    duration_s: float = 20.0,
    plain_s: float = 10.0,
    slept_s: float = 5.0,
    rate_hz: float = 500.0,
    realtime: bool = True,
) -> Result:
    """An engine of six virtual joints and the node, as processes in a domain of their own.

    plain_s: duration for a straightforward rclpy node on the same engine, for comparison; 0 omits it.
    slept_s: duration for the engine alone, as shipped and again with sleep instead of busy waiting, which shows the
    cost and gain of the latter; 0 omits it. realtime: all of them get the supervisor's priority, if permitted.
    """
    priority = load(SupervisorParams, "supervisor").realtime_priority["manipulator_state"] if realtime else 0
    domain = 1 + os.getpid() % 19  # tests have those from 20 on
    with own_environment(domain) as environment:
        cycle_log = Path(environment["ROBOT_STACK_RUNTIME_DIR"]) / "cycles.npy"
        from tests.benchmarks.nodes.joint_listener import JointListener

        start = Processes(environment, priority)
        with start(_ENGINE, str(cycle_log)), JointListener(domain) as listener, connect("bench"):
            ours = _measure(listener, start, _NODE, duration_s, rate_hz)
            plain = _measure(listener, start, _PLAIN, plain_s, rate_hz) if plain_s else None
            reads_us, repeated_us = _status_reads(_READ_PAUSE_S), _status_reads(0.0)
        late_us = _late_us(cycle_log, ours.window_ns)
        alone = _engine_alone(start, cycle_log, slept_s) if slept_s else None
        asleep = _engine_alone(start, cycle_log, slept_s, "sleep") if slept_s else None
    figures = {
        "joint_states_hz": ours.rate_hz,
        "joint_states_hz_off": abs(ours.rate_hz - rate_hz),
        "period_jitter_ms_p99": percentile(ours.period_jitter_ms, 0.99),
        "period_jitter_ms_p50": percentile(ours.period_jitter_ms, 0.5),
        "arrival_jitter_ms_p99": percentile(ours.arrival_jitter_ms, 0.99),
        "cpu_pct": ours.cpu_pct,
        "lost": ours.lost,
        "pss_mb": ours.pss_mb,
        "status_read_us_p50": percentile(reads_us, 0.5),
        "status_read_us_p99": percentile(reads_us, 0.99),
        "status_read_repeated_us_p50": percentile(repeated_us, 0.5),
        "engine_cycle_jitter_us_p99": percentile(late_us, 0.99),
        "engine_cycle_jitter_us_p50": percentile(late_us, 0.5),
    }
    if plain is not None:
        figures |= {
            "plain_joint_states_hz": plain.rate_hz,
            "plain_period_jitter_ms_p99": percentile(plain.period_jitter_ms, 0.99),
            "plain_cpu_pct": plain.cpu_pct,
        }
    if alone is not None and asleep is not None:
        figures |= {
            "engine_cpu_pct": alone.cpu_pct,
            "engine_cpu_pct_asleep": asleep.cpu_pct,
            "engine_cycle_jitter_us_p99_asleep": percentile(asleep.late_us, 0.99),
            "engine_cycle_jitter_us_p50_asleep": percentile(asleep.late_us, 0.5),
        }
    conditions = {
        "joint_states_hz": "messages that an independent subscriber got (raw bytes, depth 500) over their stamps' span",
        "lost": "periods in that span without a message: left out by the node, or not delivered",
        "period_jitter": "|period - nominal| between stamps that the node takes right before it publishes",
        "arrival_jitter": "the same at the independent subscriber, a Python process on the same machine",
        "cpu_pct": "of one core: all threads of the node's process, heartbeat and diagnostics included, two topics",
        "status_read": f"{_READS} reads, {1e3 * _READ_PAUSE_S:g} ms apart, in another process; repeated: no pause",
        "engine_cycle_jitter": "begin of a cycle after its deadline, in the window in which the node was measured",
        "plain": "rclpy timer, message built and filled at each tick, same engine and topics",
        "realtime_priority": f"SCHED_RR {start.priority}" if start.priority else "none",
        "topics": ["/joint_states", "/gazebo_position_controller/commands"],
        "engine_cpu_pct": "the engine alone, communicating; asleep: the same without waiting awake before its cycles",
        "messages": len(ours.period_jitter_ms) + 1,
        "cycles": len(late_us),
        "domain": domain,
    }
    return Result(figures, conditions)


def _measure(
    listener: JointListener, start: Processes, module: tuple[str, ...], duration_s: float, rate_hz: float
) -> Measured:
    with start(*module) as process:
        listener.wait(_SETTLE)
        used, begin_ns = ProcessLoad(process), time.monotonic_ns()
        arrived_ns, stamped_ns = listener.run(duration_s)
        used_pct, end_ns, memory_mb = used.cpu_pct(), time.monotonic_ns(), pss_mb(process)
    period_ns = 1e9 / rate_hz
    return Measured(
        rate_hz=1e9 * (len(stamped_ns) - 1) / float(stamped_ns[-1] - stamped_ns[0]),
        period_jitter_ms=_off_ms(stamped_ns, period_ns),
        arrival_jitter_ms=_off_ms(arrived_ns, period_ns),
        cpu_pct=used_pct,
        lost=max(0, round(float(stamped_ns[-1] - stamped_ns[0]) / period_ns) + 1 - len(stamped_ns)),
        pss_mb=memory_mb,
        window_ns=(begin_ns, end_ns),
    )


def _late_us(cycle_log: Path, window_ns: tuple[int, int]) -> list[float]:
    """Delays of the window's cycles after their deadlines, us."""
    due_ns, began_ns = np.load(cycle_log).T
    within = (due_ns >= window_ns[0]) & (due_ns < window_ns[1])
    late: list[float] = ((began_ns - due_ns)[within] * 1e-3).tolist()
    return late


def _engine_alone(start: Processes, cycle_log: Path, duration_s: float, *how: str) -> EngineMeasured:
    with start(_ENGINE, str(cycle_log), *how) as process, connect("bench") as engine:
        engine.api.StartCommunication(10000)
        time.sleep(_WARM_S)
        begin_ns = time.monotonic_ns()
        used_pct = cpu_pct(process, duration_s)
        end_ns = time.monotonic_ns()
    return EngineMeasured(used_pct, _late_us(cycle_log, (begin_ns, end_ns)))


def _off_ms(times_ns: NDArray[np.int64], period_ns: float) -> list[float]:
    off: list[float] = (np.abs(np.diff(times_ns) - period_ns) * 1e-6).tolist()
    return off


def _status_reads(pause_s: float) -> list[float]:
    """Durations of many status reads, us."""
    taken_us = []
    with connect("bench") as engine:
        for _ in range(_READS):
            begin_ns = time.perf_counter_ns()
            engine.read_status()
            taken_us.append((time.perf_counter_ns() - begin_ns) * 1e-3)
            if pause_s:
                time.sleep(pause_s)
    return taken_us
