"""The robot's summary: unknown is NaN or empty, never zero."""

from __future__ import annotations

import math

import pytest

from robot_stack.contract.model import SafetyState
from robot_stack.system_monitor.robot_status import Battery, Mission, Safety, Summary, current_mission


@pytest.mark.parametrize(("charge", "percent"), [(0.0, 0.0), (0.805, 80.5), (1.0, 100.0)])
def test_charge_in_percent(charge: float, percent: float) -> None:
    assert Battery(48.0, charge, -2.0).percent == pytest.approx(percent)


@pytest.mark.parametrize("charge", [math.nan, -0.01, 1.01, 80.0])
def test_a_charge_that_cannot_be_is_unknown(charge: float) -> None:
    assert math.isnan(Battery(charge=charge).percent)


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


def test_every_safety_state_is_shown() -> None:
    assert all(Safety(state.name).shown for state in SafetyState)


@pytest.mark.parametrize("state", ["RUNNING", "WAITING", "PAUSED"])
def test_active_mission_is_current_mission(state: str) -> None:
    mission = Mission("tour", "gate", 1, 4)
    assert current_mission(state, mission) == mission


@pytest.mark.parametrize("state", ["IDLE", "COMPLETED", "ABORTED", "FAILED", ""])
def test_inactive_mission_is_not_current_mission(state: str) -> None:
    assert current_mission(state, Mission("tour", "gate", 4, 4)) == Mission("", "", 0, 0)


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
