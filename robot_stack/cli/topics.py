"""topics: every row of the contract against the live graph."""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from robot_stack.supervisor.profile import Plan
    from robot_stack.system_monitor.nodes.topic_meter import Meter
    from robot_stack.system_monitor.topic_check import Finding

# Relative tolerance of one row's rate; benchmarks measure longer and are stricter.
TOLERANCE = 0.1


def topics(
    profile: Annotated[
        str | None, typer.Option("--profile", "-p", help="Profile to compare with; by default the running one.")
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="Measure once instead of following.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Measure once, as JSON.")] = False,
    window_s: Annotated[float, typer.Option("--window", min=0.5, help="Seconds over which rates are measured.")] = 3.0,
) -> None:
    """Compare every topic of the contract with the graph: type, QoS, rate, age; name what is missing or different.

    Exit code 1 (with --once or --json) if something is missing or different.
    """
    plan = _plan(profile)
    rows = _rows(plan)
    follow = sys.stdout.isatty() and not once and not as_json
    from robot_stack.system_monitor.nodes.topic_meter import Meter

    with Meter(rows) as meter:
        meter.settle()
        if follow:
            _follow(meter, plan, window_s)
            return
        meter.run(window_s)
        findings, unknown = _judge(meter, plan)
    if as_json:
        print(json.dumps(_as_json(plan, findings, unknown), indent=2))
    else:
        from robot_stack.cli.tables import console
        from robot_stack.cli.topics_table import topics_table

        console().print(topics_table(plan.name, findings, unknown))
    raise typer.Exit(1 if unknown or any(finding.problems for finding in findings) else 0)


def _plan(profile: str | None) -> Plan:
    from robot_stack.supervisor.profile import load_plan

    return load_plan(profile) if profile is not None else running_plan() or load_plan("sim")


def running_plan() -> Plan | None:
    """What the running stack runs; None if none runs."""
    from robot_stack.supervisor.control import NotRunning, ask
    from robot_stack.supervisor.profile import load_plan

    try:
        status = ask("status")
    except (NotRunning, TimeoutError):
        return None
    plan = load_plan(status["profile_path"], only=[item["name"] for item in status["processes"]])
    return replace(plan, use_sim_time=status["use_sim_time"])


def _rows(plan: Plan) -> Sequence[Any]:
    from robot_stack.system_monitor.topic_check import rows_of

    return rows_of(plan.machine, plan.use_sim_time)


def _judge(meter: Meter, plan: Plan) -> tuple[tuple[Finding, ...], tuple[str, ...]]:
    from robot_stack.system_monitor.topic_check import judge_all, unknown_topics

    rows = _rows(plan)
    nodes = frozenset(node for process in plan.processes for node in process.nodes)
    return judge_all(rows, meter.seen(), nodes, TOLERANCE), unknown_topics(meter.topic_names(), rows)


def _follow(meter: Meter, plan: Plan, window_s: float) -> None:
    from rich.live import Live

    from robot_stack.cli.tables import console
    from robot_stack.cli.topics_table import topics_table

    with contextlib.suppress(KeyboardInterrupt), Live(console=console(), auto_refresh=False) as live:
        while True:
            meter.run(window_s)
            live.update(topics_table(plan.name, *_judge(meter, plan)), refresh=True)


def _as_json(plan: Plan, findings: Sequence[Finding], unknown: Sequence[str]) -> dict[str, Any]:
    return {
        "profile": plan.name,
        "topics": [
            {
                "name": finding.row.name,
                "type": finding.row.type,
                "qos": finding.row.qos.describe(),
                "rate_hz": finding.expected_hz,
                "measured_hz": finding.seen.traffic.rate_hz,
                "age_s": finding.seen.traffic.age_s,
                "publishers": sorted({endpoint.node for endpoint in finding.seen.publishers}),
                "subscribers": sorted({endpoint.node for endpoint in finding.seen.subscribers}),
                "verdict": finding.verdict.value,
                "problems": list(finding.problems),
            }
            for finding in findings
        ],
        "unknown": list(unknown),
    }
