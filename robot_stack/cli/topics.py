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
    from rich.table import Table

    from robot_stack.bench.graph import Finding
    from robot_stack.bench.nodes.meter import Meter
    from robot_stack.supervisor.profile import Plan

# One row's rate is right within this; benchmarks measure longer and ask for more.
TOLERANCE = 0.1
_STYLES = {"ok": "", "quiet": "", "not run": "dim", "wrong": "red"}


def topics(
    profile: Annotated[
        str | None, typer.Option("--profile", "-p", help="Profile to compare with; by default the running one.")
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="Measure once instead of following.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Measure once, as JSON.")] = False,
    window_s: Annotated[float, typer.Option("--window", min=0.5, help="Seconds over which rates are measured.")] = 3.0,
) -> None:
    """Compare every topic of the contract with the graph: type, QoS, rate, age; name what is missing or different.

    Exit code 1 (with --once or --json) if something is.
    """
    plan = _plan(profile)
    rows = _rows(plan)
    follow = sys.stdout.isatty() and not once and not as_json
    from robot_stack.bench.nodes.meter import Meter

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
        _console().print(_table(plan, findings, unknown))
    raise typer.Exit(1 if unknown or any(finding.problems for finding in findings) else 0)


def _plan(profile: str | None) -> Plan:
    from robot_stack.supervisor.control import NotRunning, ask
    from robot_stack.supervisor.profile import load_plan

    if profile is not None:
        return load_plan(profile)
    try:
        status = ask("status")
    except (NotRunning, TimeoutError):
        return load_plan("sim")
    plan = load_plan(status["profile_path"], only=[item["name"] for item in status["processes"]])
    return replace(plan, use_sim_time=status["use_sim_time"])


def _rows(plan: Plan) -> Sequence[Any]:
    from robot_stack.bench.graph import rows_of

    return rows_of(plan.machine, plan.use_sim_time)


def _judge(meter: Meter, plan: Plan) -> tuple[tuple[Finding, ...], tuple[str, ...]]:
    from robot_stack.bench.graph import judge_all, unknown_topics

    rows = _rows(plan)
    nodes = frozenset(node for process in plan.processes for node in process.nodes)
    return judge_all(rows, meter.seen(), nodes, TOLERANCE), unknown_topics(meter.topic_names(), rows)


def _follow(meter: Meter, plan: Plan, window_s: float) -> None:
    from rich.live import Live

    with contextlib.suppress(KeyboardInterrupt), Live(console=_console(), auto_refresh=False) as live:
        while True:
            meter.run(window_s)
            live.update(_table(plan, *_judge(meter, plan)), refresh=True)


def _console() -> Any:
    from rich.console import Console

    # A pipe has no width; cutting columns there would lose what a reader searches for.
    return Console() if sys.stdout.isatty() else Console(width=200)


def _table(plan: Plan, findings: Sequence[Finding], unknown: Sequence[str]) -> Table:
    from rich.table import Table

    wrong = sum(bool(finding.problems) for finding in findings)
    caption = f"{wrong} topics differ from the contract" if wrong else "as in the contract"
    if unknown:
        caption += f"; not in the contract: {', '.join(unknown)}"
    table = Table(title=f"topics, profile {plan.name}", caption=caption, caption_justify="left")
    for name in ("topic", "type", "QoS", "rate", "measured", "age", "publishers", ""):
        table.add_column(name, justify="right" if name in ("rate", "measured", "age") else "left")
    for finding in findings:
        table.add_row(*_cells(finding), style=_STYLES[finding.verdict.value])
    return table


def _cells(finding: Finding) -> list[str]:
    row, seen = finding.row, finding.seen
    publishers = {endpoint.node for endpoint in seen.publishers}
    return [
        row.name,
        row.type.split("/")[-1],
        f"{row.qos.reliability.name}, {row.qos.durability.name}",
        "event" if finding.expected_hz is None else f"{finding.expected_hz:g} Hz",
        f"{seen.traffic.rate_hz:.1f} Hz" if seen.traffic.age_s is not None else "-",
        f"{seen.traffic.age_s:.2f} s" if seen.traffic.age_s is not None else "-",
        ", ".join(sorted(publishers)) if len(publishers) < 4 else f"{len(publishers)} nodes",
        "; ".join(finding.problems) or finding.verdict.value,
    ]


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
