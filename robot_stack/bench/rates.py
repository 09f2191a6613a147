"""Rates of all topics of the running stack while the robot drives, speed of the world, processor and memory."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from robot_stack.bench.commands import robot_stack
from robot_stack.bench.framework import Aim, BenchError, Result
from robot_stack.bench.graph import judge_all, rows_of, worst_rate_error
from robot_stack.bench.own_engine import PRIORITY, go_first
from robot_stack.bench.stack import Load, running_stack
from robot_stack.contract import topics
from robot_stack.supervisor.profile import load_plan

NAME = "rates"
AIMS = {"worst_rate_error_pct": Aim("<", 2.0), "sim_speed": Aim(">=", 1.0)}
_TOLERANCE = 0.02
_SETTLE_S = 10.0
# Images and point clouds are 100 MB/s together. To take them all beside a stack that needs most of the machine would
# measure the meter, so each is counted by itself, for so long.
_HEAVY = frozenset({"sensor_msgs/msg/Image", "sensor_msgs/msg/PointCloud2"})
_HEAVY_S = 10.0


def run(duration_s: float = 30.0, profile: str = "sim", mission: str = "yard_tour") -> Result:
    """mission: driven meanwhile; empty to measure at rest. Raises BenchError if the stack does not run well."""
    from robot_stack.bench.nodes.meter import Meter
    from robot_stack.bench.nodes.world_speed import world_speed

    with tempfile.TemporaryDirectory() as folder, running_stack(profile, own=[_journal(folder)]) as status:
        plan = load_plan(status["profile_path"], only=[item["name"] for item in status["processes"]])
        if status["use_sim_time"]:
            raise BenchError("rates are measured at real time; this stack lives on /clock")
        rows = rows_of(plan.machine, plan.use_sim_time)
        if mission:
            robot_stack("reset", check=False)  # a slow start may have latched something
            robot_stack("mission", "start", mission)
        # Who counts must not wait for the processor behind those whose messages it counts.
        first = go_first(0, PRIORITY)
        try:
            with Meter([row for row in rows if row.type not in _HEAVY]) as meter:
                meter.settle(_SETTLE_S)
                load, speed = Load(status), world_speed()
                begun_s = time.monotonic()
                meter.run(duration_s)
                elapsed_s = time.monotonic() - begun_s
                cpu_cores, sim_speed = load.cpu_cores(elapsed_s), speed()
                seen = meter.seen()
            for row in rows:
                if row.type in _HEAVY:
                    with Meter([row]) as meter:
                        meter.settle(_SETTLE_S)
                        meter.run(_HEAVY_S)
                        seen |= meter.seen()
            nodes = frozenset(node for process in plan.processes for node in process.nodes)
            findings = judge_all(rows, seen, nodes, _TOLERANCE)
        finally:
            if mission:
                robot_stack("mission", "abort", check=False)
        measured = [finding for finding in findings if finding.row.rate_hz and finding.seen.publishers]
        if not measured:
            raise BenchError("no topic with a rate was published")
        error, name = worst_rate_error(findings)
        return Result(
            {
                "worst_rate_error_pct": 100.0 * error,
                "sim_speed": round(
                    sim_speed, 3
                ),  # the clocks of start and end are read some 10 us apart from the status
                "cpu_cores": cpu_cores,
                "pss_mb": load.pss_mb(),
                "topics": len(measured),
            },
            {
                "profile": plan.name,
                "processes": len(plan.processes),
                "realtime_priority_of_the_meter": PRIORITY if first else 0,
                "riding": mission or "no",
                "heavy_topics": f"images and point clouds one after the other, {_HEAVY_S:.0f} s each",
                "worst_topic": name,
                "rates_hz": {
                    finding.row.name: round(finding.seen.traffic.rate_hz, 2)
                    for finding in measured
                    if finding.row is not topics.CLOCK
                },
                "problems": {f.row.name: list(f.problems) for f in findings if f.problems},
            },
        )


def _journal(folder: str) -> str:
    """A journal of its own: this ride neither meets nor leaves an unfinished mission."""
    return f"mission_manager.journal_file={Path(folder) / 'mission.db'}"
