"""Rates of all topics of the running stack at rest, riding and recording; speed of the world, processor and memory."""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robot_stack.contract import topics
from robot_stack.supervisor.profile import Plan, load_plan
from robot_stack.system_monitor.topic_check import Finding, judge_all, rows_of, worst_rate_error
from tests.benchmarks.support.commands import robot_stack
from tests.benchmarks.support.framework import Aim, BenchError, Result
from tests.benchmarks.support.own_engine import PRIORITY, go_first
from tests.benchmarks.support.stack import Load, running_stack

if TYPE_CHECKING:
    from robot_stack.system_monitor.nodes.topic_meter import Meter

AIMS = {
    "worst_rate_error_pct": Aim("<", 2.0),
    "rest_rate_error_pct": Aim("<", 2.0),
    "recording_rate_error_pct": Aim("<", 2.0),
    "sim_speed": Aim(">=", 1.0),
    "cpu_cores": Aim("<", 0.9),
    "robot_cpu_cores": Aim("<", 0.5),
    "meter_cpu_pct": Aim("<", 3.0),
    "pss_mb": Aim("<", 900.0),
}
_TOLERANCE = 0.02
_SETTLE_S = 10.0
_RECORDER_END_S = 20.0


@dataclass(frozen=True, slots=True)
class _Phase:
    """Results of one window. cpu_cores: by process."""

    findings: tuple[Finding, ...]
    sim_speed: float
    cpu_cores: dict[str, float]
    meter_cpu_pct: float

    @property
    def worst(self) -> tuple[float, str]:
        """The greatest rate error, and the topic."""
        return worst_rate_error(self.findings)


def run(duration_s: float = 30.0, profile: str = "sim", mission: str = "yard_tour") -> Result:
    """Three windows of ``duration_s``: at rest, while the robot rides ``mission``, and the same with a recorder.

    sim_speed, cores, memory and the meter's share are those of the ride. Rates are in the stack's time.
    Raises BenchError if the stack does not run well.
    """
    from robot_stack.system_monitor.nodes.topic_meter import Meter

    with tempfile.TemporaryDirectory() as folder, running_stack(profile, own=[_journal(folder)]) as status:
        plan = load_plan(status["profile_path"], only=[item["name"] for item in status["processes"]])
        rows = rows_of(plan.machine, status["use_sim_time"])
        # The meter must not wait for the processor behind the publishers that it measures.
        first = go_first(0, PRIORITY)
        with Meter(rows) as meter:
            meter.settle(_SETTLE_S)
            rest = _measure(meter, plan, status, duration_s)
            with _riding(mission):
                ride = _measure(meter, plan, status, duration_s)
                memory_mb = Load(status).pss_mb()
            with _riding(mission), _recording(folder):
                recorded = _measure(meter, plan, status, duration_s)
        return _result(plan, mission, first, memory_mb, rest, ride, recorded)


def _measure(meter: Meter, plan: Plan, status: dict[str, Any], duration_s: float) -> _Phase:
    load = Load(status)
    begun_s = time.monotonic()
    meter.run(duration_s)
    cores = load.cores_by_process(time.monotonic() - begun_s)
    nodes = frozenset(node for process in plan.processes for node in process.nodes)
    rows = rows_of(plan.machine, status["use_sim_time"])
    findings = judge_all(rows, meter.seen(), nodes, _TOLERANCE)
    if not any(finding.row.rate_hz and finding.seen.publishers for finding in findings):
        raise BenchError("no topic with a rate was published")
    return _Phase(findings, meter.speed(), cores, meter.cpu_pct)


def _result(
    plan: Plan, mission: str, first: bool, memory_mb: float, rest: _Phase, ride: _Phase, recorded: _Phase
) -> Result:
    simulation = {process.name for process in plan.processes if process.system is topics.SIM_BODIES.system}
    rates = {
        finding.row.name: round(finding.seen.traffic.rate_hz, 2)
        for finding in ride.findings
        if finding.row.rate_hz and finding.seen.publishers
    }
    return Result(
        {
            "worst_rate_error_pct": 100.0 * ride.worst[0],
            "rest_rate_error_pct": 100.0 * rest.worst[0],
            "recording_rate_error_pct": 100.0 * recorded.worst[0],
            # The clock ticks every 10 ms: half a minute resolves a thousandth.
            "sim_speed": round(ride.sim_speed, 3),
            "cpu_cores": sum(ride.cpu_cores.values()),
            "robot_cpu_cores": sum(cores for name, cores in ride.cpu_cores.items() if name not in simulation),
            "rest_cpu_cores": sum(rest.cpu_cores.values()),
            "meter_cpu_pct": ride.meter_cpu_pct,
            "pss_mb": memory_mb,
            "topics": len(rates),
        },
        {
            "profile": plan.name,
            "processes": len(plan.processes),
            "realtime_priority_of_the_meter": PRIORITY if first else 0,
            "mission": mission,
            "worst_topics": {"rest": rest.worst[1], "riding": ride.worst[1], "recording": recorded.worst[1]},
            "cpu_pct": {name: round(100.0 * cores, 1) for name, cores in ride.cpu_cores.items()},
            "rest_cpu_pct": {name: round(100.0 * cores, 1) for name, cores in rest.cpu_cores.items()},
            "rates_hz": rates,
            "problems": {f.row.name: list(f.problems) for f in ride.findings if f.problems},
        },
    )


@contextmanager
def _riding(mission: str) -> Iterator[None]:
    robot_stack("mission", "start", mission)
    try:
        yield
    finally:
        robot_stack("mission", "abort", check=False)


@contextmanager
def _recording(folder: str) -> Iterator[None]:
    """A recorder with an operator's default options, with images and sweeps."""
    command = [sys.executable, "-m", "robot_stack.cli", "record", "--output", folder]
    recorder = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield
        if recorder.poll() is not None:
            raise BenchError(f"the recorder ended with code {recorder.returncode}")
    finally:
        recorder.send_signal(signal.SIGINT)
        recorder.wait(_RECORDER_END_S)


def _journal(folder: str) -> str:
    """A separate journal: this ride neither finds nor leaves an unfinished mission."""
    return f"mission_manager.journal_file={Path(folder) / 'mission.db'}"
