"""The timing of the departure warning."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.config import load
from robot_stack.core.departure import Departure, DepartureParams
from robot_stack.core.geometry import ZERO_TWIST, Twist2

PARAMS = load(DepartureParams, "departure")
MOVING = Twist2(0.5, 0.0, 0.0)


def warned_s(departure: Departure, dt_s: float = 0.1) -> float:
    """Returns the seconds of warning until the departure is permitted."""
    seconds = 0.0
    while not departure.cleared(dt_s):
        assert departure.warning
        assert departure.remaining_s == pytest.approx(PARAMS.warning_s - seconds, abs=1e-6)
        departure.elapse(ZERO_TWIST, dt_s)
        seconds += dt_s
    return seconds


def test_departure_after_power_on_warns_fully_and_reports_departure_once() -> None:
    departure = Departure(PARAMS)
    assert departure.remaining_s is None
    assert warned_s(departure) == pytest.approx(2.0)
    assert departure.remaining_s == 0.0
    departure.elapse(ZERO_TWIST, 0.1)
    assert departure.remaining_s is None, "said once"


@pytest.mark.parametrize("twist", [None, Twist2(math.nan, 0.0, 0.0), ZERO_TWIST, Twist2(0.02, 0.0, -0.02)])
def test_unknown_or_slow_twist_counts_as_standstill(twist: Twist2 | None) -> None:
    for slow in (Twist2(0.03, 0.0, 0.0), Twist2(0.0, -0.03, 0.0), Twist2(0.0, 0.0, 0.03)):
        departure = Departure(PARAMS)
        departure.elapse(slow, 0.1)
        assert departure.stood_s == 0.0
    departure = Departure(PARAMS)
    departure.elapse(MOVING, 1.0)
    assert departure.moving
    departure.elapse(twist, PARAMS.after_s)
    assert not departure.moving
    assert not departure.due, "10 s are not more than 10 s"
    departure.elapse(twist, 0.1)
    assert departure.due


def test_a_dropped_warning_is_given_in_full_again() -> None:
    departure = Departure(PARAMS)
    for _ in range(15):
        assert not departure.cleared(0.1)
    departure.drop()
    assert not departure.warning
    assert departure.remaining_s is None
    assert warned_s(departure) == pytest.approx(2.0)


@pytest.mark.parametrize("announced", [True, False])
def test_external_departure_warning_ends_the_own_one_and_is_valid_for_ten_seconds(announced: bool) -> None:
    departure = Departure(PARAMS, announced=announced)
    if not announced:
        assert not departure.cleared(0.1)
        departure.announced()
    assert departure.cleared(0.1)
    assert not departure.warning
    departure.elapse(ZERO_TWIST, PARAMS.after_s + 0.1)
    assert not departure.cleared(0.1)
