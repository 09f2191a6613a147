"""The state to show, from requests and known states."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robot_stack.contract.display import Display
from robot_stack.ehmi.choice import Safety, Situation, after_mission_manager, choose

CALM = Situation(emergency=False, safety=Safety.FRESH, asked=None, passenger=False)


@pytest.mark.parametrize("asked", [None, *Display])
@pytest.mark.parametrize("safety", Safety)
@pytest.mark.parametrize("passenger", [False, True])
def test_emergency_stop_overrides_requested_display(asked, safety, passenger):
    assert choose(Situation(True, safety, asked, passenger, "RUNNING", "SERVOING")) is Display.EMERGENCY_STOP


@pytest.mark.parametrize("asked", Display)
def test_requested_display_is_shown(asked):
    assert choose(replace(CALM, asked=int(asked))) is asked


@pytest.mark.parametrize("asked", [None, *Display])
def test_a_safety_monitor_that_is_not_there(asked):
    assert choose(replace(CALM, asked=asked, safety=Safety.UNKNOWN)) is Display.OFF
    assert choose(replace(CALM, asked=asked, safety=Safety.SILENT)) is Display.ERROR


@pytest.mark.parametrize("asked", Display)
def test_display_with_passenger_replaces_states_of_empty_robot(asked):
    other = {Display.IDLE: Display.PASSENGER_ONBOARD, Display.NAVIGATING: Display.TRANSPORT,
             Display.APPROACHING_CHAIR: Display.TRANSPORT}  # fmt: skip
    assert choose(replace(CALM, asked=asked, passenger=True)) is other.get(asked, asked)


@pytest.mark.parametrize("asked", [None, *Display])
def test_only_a_display_that_is_off_outlives_its_mission_manager(asked):
    assert after_mission_manager(asked) == (Display.OFF if asked == Display.OFF else None)


@pytest.mark.parametrize(
    ("mission", "docking", "passenger", "state"),
    [
        ("", "", False, Display.IDLE),
        ("IDLE", "IDLE", False, Display.IDLE),
        ("COMPLETED", "IDLE", True, Display.PASSENGER_ONBOARD),
        ("RUNNING", "IDLE", False, Display.NAVIGATING),
        ("RUNNING", "DOCKED", True, Display.TRANSPORT),
        ("WAITING", "IDLE", False, Display.PAUSED),
        ("PAUSED", "IDLE", False, Display.PAUSED),
        ("FAILED", "IDLE", False, Display.ERROR),
        ("", "APPROACH", False, Display.APPROACHING_CHAIR),
        ("RUNNING", "SEARCH", False, Display.DOCKING),
        ("RUNNING", "SERVOING", False, Display.DOCKING),
        ("", "FINE_ALIGN", False, Display.DOCKING),
        ("FAILED", "FAILED", False, Display.DOCKING_FAILED),
        ("", "DOCKED", False, Display.DOCKING_COMPLETE),
        ("", "DOCKED", True, Display.PASSENGER_ONBOARD),
    ],
)
def test_display_without_request_is_derived_from_mission_and_docking(mission, docking, passenger, state):
    assert choose(replace(CALM, mission=mission, docking=docking, passenger=passenger)) is state
