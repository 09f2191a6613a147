"""A docking started by hand after a long standstill warns of the departure first."""

from __future__ import annotations

import pytest

from robot_stack.contract.states import DockingState
from robot_stack.core.config import load
from robot_stack.core.departure import SETTING_OUT, Departure, DepartureParams
from robot_stack.core.geometry import ZERO_TWIST
from tests.unit.docking.bench import TICK_S, Bench, emergency, stopped

PARAMS = load(DepartureParams, "departure")


@pytest.fixture
def stood() -> Bench:
    """A robot at staging whose departure has not been announced."""
    return Bench(departure=Departure(PARAMS))


def warnings(bench: Bench) -> int:
    """Returns the number of ticks with a warning so far."""
    return sum(output.text == SETTING_OUT for output in bench.outputs)


def moves(bench: Bench) -> bool:
    return bench.outputs[-1].twist not in (None, ZERO_TWIST)


def test_a_docking_from_staging_warns_for_two_seconds_and_no_more(stood: Bench) -> None:
    assert stood.begin() is None
    begun_s = stood.now_s
    assert stood.run(lambda: moves(stood))
    assert stood.now_s - begun_s >= PARAMS.warning_s
    assert stood.run_to_end().success
    assert warnings(stood) == pytest.approx(PARAMS.warning_s / TICK_S, abs=1)


def test_docking_after_announced_navigation_skips_departure_warning(stood: Bench) -> None:
    stood.departure.announced()
    assert stood.begin() is None
    assert stood.run_to_end().success
    assert warnings(stood) == 0


def test_an_undocking_warns_once_the_latch_is_open(stood: Bench) -> None:
    stood.docked()
    stood.run(lambda: False, PARAMS.after_s + 1.0)
    before = warnings(stood)
    assert stood.controller.undock(stood.situation()) is None
    assert stood.run(lambda: warnings(stood) > before)
    assert stood.inputs().open
    assert stood.run_to_end().success
    assert warnings(stood) - before == pytest.approx(PARAMS.warning_s / TICK_S, abs=1)


def test_safety_stop_during_docking_warning_restarts_warning(stood: Bench) -> None:
    stood.begin()
    stood.run(lambda: warnings(stood) > 20)
    stood.safety = stopped()
    stood.run(lambda: False, 1.0)
    assert not stood.departure.warning
    stood.safety = type(stood.safety)(known=True)
    before = warnings(stood)
    assert stood.run(lambda: moves(stood))
    assert warnings(stood) - before == pytest.approx(PARAMS.warning_s / TICK_S, abs=1)


def test_an_emergency_stop_and_a_cancel_end_the_warning(stood: Bench) -> None:
    stood.begin()
    stood.run(lambda: warnings(stood) > 10)
    stood.controller.cancel()
    stood.step()
    assert not stood.departure.warning
    stood.begin()
    stood.run(lambda: stood.departure.warning)
    stood.safety = emergency()
    stood.run_to_end()
    stood.step()
    assert stood.state is DockingState.FAILED
    assert not stood.departure.warning
