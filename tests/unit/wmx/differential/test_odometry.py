"""Odometry of two wheels: exact arcs, rejected jumps, and the growth of the uncertainty."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.geometry import IDENTITY
from robot_stack.wmx.differential.kinematics import BaseGeometry, WheelPair
from robot_stack.wmx.differential.odometry import Odometry, WheelOdometry, WheelReading
from robot_stack.wmx.differential.params import OdometryParams

BASE = BaseGeometry(radius_m=0.1, track_m=0.5)
PARAMS = OdometryParams(
    shortest_interval_s=0.05,
    longest_gap_s=1.0,
    deviation_per_sqrt_m=0.02,
    twist_deviation_mps=0.01,
    twist_deviation_radps=0.01,
)
MAX_RADPS = 20.0


def driven(*ways: tuple[float, float], steps: int = 1) -> Odometry:
    """Returns the odometry after moves of (left, right) in rad, each within half a second."""
    odometry = WheelOdometry(BASE, PARAMS, MAX_RADPS)
    left, right, stamp_s = 3.0, -7.0, 100.0
    result = odometry.update(WheelReading(stamp_s, WheelPair(left, right)))
    for way in ways:
        for _ in range(steps):
            left, right, stamp_s = left + way[0] / steps, right + way[1] / steps, stamp_s + 0.5
            result = odometry.update(WheelReading(stamp_s, WheelPair(left, right)))
            assert result.fault == ""
    return result


def xyyaw(odometry: Odometry) -> tuple[float, float, float]:
    return odometry.pose.x, odometry.pose.y, odometry.pose.yaw


def test_first_reading_only_sets_the_zero() -> None:
    assert driven() == Odometry()


def test_quarter_circle_of_one_metre_in_one_reading() -> None:
    """The exact arc ends at (1, 1); the chord of an Euler step would not."""
    left, right = 0.5 * math.pi * 0.75 / 0.1, 0.5 * math.pi * 1.25 / 0.1
    assert xyyaw(driven((left, right))) == pytest.approx((1.0, 1.0, 0.5 * math.pi))


@given(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.integers(2, 20))
def test_how_often_an_arc_is_read_does_not_matter(left: float, right: float, steps: int) -> None:
    assert xyyaw(driven((left, right), steps=steps)) == pytest.approx(xyyaw(driven((left, right))), abs=1e-9)


@given(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0))
def test_there_and_back_is_the_start(left: float, right: float) -> None:
    assert xyyaw(driven((left, right), (-left, -right))) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


BEFORE = WheelReading(100.0, WheelPair(1.0, 1.0))


@pytest.mark.parametrize(
    ("reading", "says"),
    [
        (WheelReading(100.01, WheelPair(1.0, 3.1)), "encoder jumped within 0.010 s: right by 2.10 rad"),
        (WheelReading(100.01, WheelPair(-9.0, 3.1)), "left by -10.00 rad, right by 2.10 rad"),
        (WheelReading(100.01, WheelPair(math.nan, 1.0)), "encoder reading is not finite"),
        (WheelReading(math.inf, WheelPair(1.0, 1.0)), "encoder reading is not finite"),
        (WheelReading(101.5, WheelPair(1.1, 1.1)), "no encoder reading for 1.50 s, at most 1.0 s"),
        (WheelReading(99.0, WheelPair(1.1, 1.1)), "the engine restarted"),
        (WheelReading(100.01, WheelPair(1.1, 1.1), generation=1), "the engine restarted"),
    ],
)
def test_implausible_reading_is_rejected_with_reason(reading: WheelReading, says: str) -> None:
    odometry = WheelOdometry(BASE, PARAMS, MAX_RADPS)
    odometry.update(BEFORE)

    after = odometry.update(reading)

    assert says in after.fault
    assert after.pose == IDENTITY


def test_odometry_continues_from_new_angles_after_jump() -> None:
    odometry = WheelOdometry(BASE, PARAMS, MAX_RADPS)
    odometry.update(BEFORE)
    odometry.update(WheelReading(100.01, WheelPair(50.0, 50.0)))
    after = odometry.update(WheelReading(100.11, WheelPair(51.0, 51.0)))
    assert after.fault == ""
    assert xyyaw(after) == pytest.approx((0.1, 0.0, 0.0))


def test_distance_during_nan_reading_is_counted() -> None:
    odometry = WheelOdometry(BASE, PARAMS, MAX_RADPS)
    odometry.update(BEFORE)
    odometry.update(WheelReading(100.05, WheelPair(math.nan, math.nan)))

    assert xyyaw(odometry.update(WheelReading(100.1, WheelPair(2.0, 2.0)))) == pytest.approx((0.1, 0.0, 0.0))


def test_uncertainty_of_a_straight_metre_by_hand() -> None:
    """Each wheel's distance has the variance q = 4e-4 m2. Mean: q/2 along. Difference over the track: 2q/0.25 of
    yaw, to which the chord adds a lateral lever arm of half a metre.
    """
    covariance = np.array(driven((10.0, 10.0)).covariance).reshape(3, 3)

    assert covariance == pytest.approx(
        np.array([[2e-4, 0.0, 0.0], [0.0, 8e-4, 1.6e-3], [0.0, 1.6e-3, 3.2e-3]]), abs=1e-12
    )


def test_uncertainty_of_an_arc_is_that_of_its_end() -> None:
    """Only the right wheel turns, so only its distance is uncertain: the end varies along a longer arc."""
    way_rad, step_rad = 1.0, 1e-5
    covariance = np.array(driven((0.0, way_rad)).covariance).reshape(3, 3)
    longer, shorter = (np.array(xyyaw(driven((0.0, way_rad + sign * step_rad)))) for sign in (1.0, -1.0))
    per_m = (longer - shorter) / (2.0 * step_rad * BASE.radius_m)
    variance_m2 = PARAMS.deviation_per_sqrt_m**2 * way_rad * BASE.radius_m

    # The Jacobians are the chord's, not the arc's: the error grows with the square of the turn, 0.2 rad here.
    assert covariance == pytest.approx(variance_m2 * np.outer(per_m, per_m), rel=0.02)


@given(st.lists(st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0)), min_size=1, max_size=8))
def test_covariance_is_one_and_never_shrinks(ways: list[tuple[float, float]]) -> None:
    covariance = np.array(driven(*ways).covariance).reshape(3, 3)
    before = np.array(driven(*ways[:-1]).covariance).reshape(3, 3)

    assert covariance == pytest.approx(covariance.T, abs=1e-12)
    assert np.linalg.eigvalsh(covariance).min() >= -1e-9
    assert covariance[2, 2] >= before[2, 2] - 1e-12


def test_standing_adds_no_uncertainty() -> None:
    assert driven((5.0, 3.0), (0.0, 0.0)).covariance == driven((5.0, 3.0)).covariance
