"""The robot's summary: unknown is NaN or empty, never zero."""

from __future__ import annotations

import math

import pytest

from robot_stack.contract.model import SafetyState
from robot_stack.system_monitor.robot_status import Battery, Mission, Safety, Summary, current_mission


@pytest.mark.parametrize(
    ("charge", "percent"),
    [(0.0, 0.0), (0.805, 80.5), (1.0, 100.0), (math.nan, math.nan), (-0.01, math.nan), (1.01, math.nan)],
)
def test_charge_in_percent_and_one_that_cannot_be_is_unknown(charge: float, percent: float) -> None:
    assert Battery(48.0, charge, -2.0).percent == pytest.approx(percent, nan_ok=True)


@pytest.mark.parametrize(
    ("state", "shown"),
    [
        ("NORMAL", "NORMAL"),
        ("DEGRADED", "DEGRADED"),
        ("COLLISION_AVOIDANCE", "DEGRADED"),
        ("EMERGENCY_STOP", "EMERGENCY_STOP"),
        ("", ""),
        ("SOMETHING", ""),
    ],
)
def test_safety_states(state: str, shown: str) -> None:
    assert Safety(state).shown == shown
    assert all(Safety(known.name).shown for known in SafetyState)


def test_only_an_active_mission_is_the_current_one() -> None:
    mission = Mission("tour", "gate", 1, 4)
    assert all(current_mission(state, mission) == mission for state in ("RUNNING", "WAITING", "PAUSED"))
    others = ("IDLE", "COMPLETED", "ABORTED", "FAILED", "")
    assert all(current_mission(state, mission) == Mission("", "", 0, 0) for state in others)


def test_all_values_are_unknown_at_first() -> None:
    summary = Summary()
    numbers = (
        summary.battery.voltage_v,
        summary.battery.percent,
        summary.battery.current_a,
        summary.quality,
        summary.usage.cpu_percent,
        summary.usage.memory_percent,
        summary.usage.disk_percent,
    )
    assert all(map(math.isnan, numbers))
    assert (summary.safety.shown, summary.safety.faults, summary.mission.mission_id) == ("", (), "")
