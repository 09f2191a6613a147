"""The tables of `topics` and `status` fit into 100 columns without truncation."""

from __future__ import annotations

import io
from typing import Any

import pytest
from rich.console import Console, RenderableType

from robot_stack.cli.status import StatusView
from robot_stack.cli.tables import WIDTH
from robot_stack.cli.topics_table import topics_table
from robot_stack.contract import processes, topics
from robot_stack.contract.graph import expected
from robot_stack.contract.model import System, Topic
from robot_stack.system_monitor.topic_check import Endpoint, Finding, Seen, Traffic, judge_all, rows_of

MACHINES = (System.ROBOT, System.WMX)


def lines(shown: RenderableType, width: int = WIDTH) -> list[str]:
    console = Console(file=io.StringIO(), width=width)
    console.print(shown)
    return console.file.getvalue().splitlines()  # type: ignore[attr-defined, no-any-return]


def nodes_of(machine: System) -> frozenset[str]:
    return frozenset(node for row in processes.PROCESSES if row.system is machine for node in row.nodes)


def as_in_the_contract(row: Topic, nodes: frozenset[str]) -> Seen:
    publishers = nodes if topics.EVERY_NODE in row.publishers else nodes & set(row.publishers)
    subscribers = expected(row.subscribers, nodes, row.sometimes)
    found, listening = (
        tuple(Endpoint(name, row.type, row.qos.reliability, row.qos.durability) for name in sorted(names))
        for names in (publishers, subscribers)
    )
    return Seen(found, listening, Traffic(100, 3.0, 0.02, (row.rate_hz,) * len(found) if row.rate_hz else ()))


def everything(machine: System, *, wrong: bool = False) -> tuple[Finding, ...]:
    """Returns the findings of all rows of a machine. wrong: no topic is published."""
    rows, nodes = rows_of(machine, use_sim_time=True), nodes_of(machine)
    return judge_all(rows, {} if wrong else {row.name: as_in_the_contract(row, nodes) for row in rows}, nodes, 0.1)


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("wrong", [False, True])
def test_all_topics_fit_and_none_is_cut(machine: System, wrong: bool) -> None:
    findings = everything(machine, wrong=wrong)
    shown = lines(topics_table("sim", findings, ["/a_stranger"]))
    assert max(map(len, shown)) <= WIDTH
    for finding in findings:
        assert any(line.startswith(f" {finding.row.name} ") for line in shown), finding.row.name
    text = " ".join(" ".join(shown).split())
    for finding in findings:
        assert all(problem in text for problem in finding.problems)
    assert "…" not in text
    assert "/a_stranger" in text
    assert ("differ from the contract" in text) == wrong


def test_a_narrow_terminal_loses_nothing() -> None:
    shown = lines(topics_table("sim", everything(System.ROBOT), []), 60)
    assert max(map(len, shown)) <= 60
    assert "…" not in "".join(shown)


def status_of_all(**of_each: Any) -> dict[str, Any]:
    entry = {"pid": 123456, "state": "restarting", "reason": "", "restarts": 12, "heartbeat_age_s": 12.3}
    return {
        "profile": "diff_drive_real",
        "domain": 101,
        "stopping": False,
        "ready": False,
        "safety": {"state": "EMERGENCY_STOP", "emergency": True, "faults": ["DRIVE_FAULT", "TILT"] * 5, "age_s": 0.1},
        "missing": ["ehmi_bridge", "touch_ui", "system_monitor"],
        "without_node": None,
        "log_dir": "/home/somebody/.local/state/robot_stack/logs/20261122-120525-domain-120",
        "processes": [
            {"name": row.name, **entry, "cpu_pct": 123.0, "pss_mb": 1234.0, **of_each} for row in processes.PROCESSES
        ],
    }


def test_status_fits_with_reasons_of_any_length() -> None:
    reason = "hung: no heartbeat for 3 s [of its loop], the 4th time within 60 s; " * 3
    shown = lines(StatusView().shown(status_of_all(reason=reason.strip())))
    assert max(map(len, shown)) <= WIDTH
    text = " ".join(" ".join(shown).split())
    assert "…" not in text
    assert text.count("[of its loop]") == 3 * len(processes.PROCESSES)
    for row in processes.PROCESSES:
        assert any(line.startswith(f" {row.name} ") and "restarting" in line for line in shown)
    assert "EMERGENCY_STOP: DRIVE_FAULT, TILT" in text
