"""The safety state that `up` prints at its end."""

from __future__ import annotations

from typing import Any

import pytest

from robot_stack.cli.safety_state import safety_lines
from robot_stack.contract.faults import FAULTS


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
