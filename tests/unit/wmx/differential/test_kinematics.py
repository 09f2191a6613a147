"""Kinematics of the differential base against the documented formulas and by properties."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.wmx.differential.kinematics import BaseGeometry, WheelAxes, WheelPair, body_twist, wheel_speeds

BASE = BaseGeometry(radius_m=0.1, track_m=0.5)
FAST = 1e9
any_float = st.floats(allow_nan=False, allow_infinity=False)
sane = st.floats(-3.0, 3.0)


def test_axes_in_any_order_that_turn_either_way() -> None:
    axes = WheelAxes(left=2, right=0, left_polarity=1, right_polarity=-1)
    assert axes.wheels([10.0, 20.0, 30.0]) == WheelPair(30.0, -10.0)
    assert axes.turned(axes.turned(WheelPair(3.0, 4.0))) == WheelPair(3.0, 4.0)


@pytest.mark.parametrize(
    ("linear_mps", "angular_radps", "left", "right"),
    [
        (0.5, 0.0, 5.0, 5.0),
        (-0.2, 0.0, -2.0, -2.0),
        (0.0, 1.0, -2.5, 2.5),
        (0.5, 2.0, 0.0, 10.0),  # about the left wheel
        (0.3, -0.4, 4.0, 2.0),
    ],
)
def test_wheel_speeds_by_hand(linear_mps: float, angular_radps: float, left: float, right: float) -> None:
    speeds = wheel_speeds(linear_mps, angular_radps, BASE, FAST)

    assert (speeds.left, speeds.right) == pytest.approx((left, right), abs=1e-12)


@given(sane, sane)
def test_twist_of_the_wheels_is_the_twist_commanded(linear_mps: float, angular_radps: float) -> None:
    twist = body_twist(wheel_speeds(linear_mps, angular_radps, BASE, FAST), BASE)

    assert twist == pytest.approx((linear_mps, angular_radps), abs=1e-12)


@given(sane, sane, st.floats(0.1, 20.0))
def test_limit_slows_both_wheels_alike(linear_mps: float, angular_radps: float, limit_radps: float) -> None:
    free = wheel_speeds(linear_mps, angular_radps, BASE, FAST)
    held = wheel_speeds(linear_mps, angular_radps, BASE, limit_radps)

    assert held.largest <= limit_radps * (1.0 + 1e-12)
    assert held.left * free.right == pytest.approx(held.right * free.left, abs=1e-9)
    assert held.largest == pytest.approx(min(free.largest, limit_radps))
    assert math.copysign(1.0, held.left) == math.copysign(1.0, free.left)


@given(any_float, any_float)
def test_every_finite_twist_gives_finite_speeds_within_the_limit(linear_mps: float, angular_radps: float) -> None:
    speeds = wheel_speeds(linear_mps, angular_radps, BASE, 20.0)

    assert math.isfinite(speeds.left)
    assert math.isfinite(speeds.right)
    assert speeds.largest <= 20.0 * (1.0 + 1e-12)
