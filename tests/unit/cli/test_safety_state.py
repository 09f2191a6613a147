"""The safety state that `up` prints at its end."""

from __future__ import annotations

from typing import Any

import pytest
from typer.testing import CliRunner

from robot_stack.cli import stack
from robot_stack.cli.app import app
from robot_stack.cli.safety_state import safety_lines
from robot_stack.contract.faults import FAULTS
from robot_stack.supervisor import client


def said(state: str, *faults: str) -> dict[str, Any]:
    return {"state": state, "emergency": state == "EMERGENCY_STOP", "faults": faults, "age_s": 0.1, "received": 3}


@pytest.mark.parametrize(
    ("safety", "line"),
    [
        (None, "safety: no status of the safety monitor"),
        (said("NORMAL"), "safety: NORMAL"),
        (said("DEGRADED", "IMU_TIMEOUT"), "safety: DEGRADED: IMU_TIMEOUT; clears when the cause is gone"),
    ],
)
def test_one_line_without_an_emergency(safety: dict[str, Any] | None, line: str) -> None:
    assert safety_lines(safety) == [line]


def test_emergency_stop_is_reported_with_faults_and_release_command() -> None:
    lines = safety_lines(said("EMERGENCY_STOP", "ESTOP_PRESSED", "LIDAR_TIMEOUT"))
    assert lines == [
        "safety: EMERGENCY_STOP: the robot does not move",
        "  ESTOP_PRESSED: any /emergency_stop true, or the button's process silent > 0.4 s (latched)",
        "  LIDAR_TIMEOUT: /sensors/lidar/points older than 0.5 s, or /sensors/overhead_lidar/points than 0.3 s",
        "  `robot-stack reset` releases it, once no stop button is pressed and the causes are gone",
    ]


def test_every_fault_of_the_contract_is_described() -> None:
    lines = safety_lines(said("EMERGENCY_STOP", *(fault.code for fault in FAULTS)))
    assert all(f"  {fault.code}: {fault.raised_when}" in "\n".join(lines) for fault in FAULTS)
    assert max(map(len, lines)) <= 120


@pytest.mark.parametrize(("pace", "deadline_s"), [(None, 5.0), (1.0, 5.0), (4.0, 5.0), (0.1, 50.0), (0.001, 100.0)])
def test_up_waits_in_the_time_of_the_world(
    monkeypatch: pytest.MonkeyPatch, pace: float | None, deadline_s: float
) -> None:
    status = {
        "processes": [{"name": "safety_monitor"}],
        "ready_after_s": 1.0,
        "missing": [],
        "log_dir": "logs",
        "sim_pace": pace,
        "sim_speed": 1.0,
    }
    waited: list[float] = []
    monkeypatch.setattr(client, "start", lambda *_: status)
    monkeypatch.setattr(stack, "settled_safety", waited.append)
    monkeypatch.setattr(stack, "ask", lambda _: status)
    result = CliRunner().invoke(app, ["up"])
    assert result.exit_code == 0, result.output
    assert waited == [pytest.approx(deadline_s)]
