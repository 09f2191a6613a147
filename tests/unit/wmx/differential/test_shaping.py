"""Twists limited in acceleration and jerk, tick by tick."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.core.limits import MotionLimits
from robot_stack.wmx.differential.command import Command
from robot_stack.wmx.differential.kinematics import REST, BaseGeometry, WheelPair, body_twist, wheel_speeds
from robot_stack.wmx.differential.shaping import TwistShaper, WheelCommand

BASE = BaseGeometry(radius_m=0.1, track_m=0.5)
MOST_RADPS = 20.0
LIMITS = MotionLimits(1e6, 1e6, 1.0, 2.0, 4.0, 8.0)
TICK_S = 0.01
SILENT = Command(0.0, 0.0, "no command for 0.25 s")


class Drive:
    """Wheels that follow their commands at once."""

    def __init__(self, limits: MotionLimits | None = LIMITS) -> None:
        self.shaper = TwistShaper(BASE, MOST_RADPS, limits, TICK_S)
        self.now_s, self.wheels = 100.0, REST
        self.twists: list[tuple[float, float]] = [(0.0, 0.0)]

    def step(self, requested: Command, dt_s: float = TICK_S) -> WheelCommand:
        self.now_s += dt_s
        shaped = self.shaper.shape(requested, self.wheels, self.now_s)
        self.wheels = shaped.speeds
        self.twists.append(body_twist(shaped.speeds, BASE))
        return shaped

    def run(self, linear_mps: float, angular_radps: float, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.step(Command(linear_mps, angular_radps))

    def accelerations(self, index: int) -> list[float]:
        return [(after[index] - before[index]) / TICK_S for before, after in itertools.pairwise(self.twists)]


def test_without_limits_the_engine_shapes_a_change() -> None:
    shaped = Drive(limits=None).step(Command(0.5, -0.2))
    assert shaped == WheelCommand(wheel_speeds(0.5, -0.2, BASE, MOST_RADPS), None)


def test_speed_grows_within_acceleration_and_jerk_and_arrives() -> None:
    drive = Drive()
    drive.run(0.8, 0.0, 2.0)
    assert drive.twists[-1] == pytest.approx((0.8, 0.0))
    rates = drive.accelerations(0)
    assert max(rates) == pytest.approx(1.0, abs=1e-6)
    assert max(abs(b - a) for a, b in itertools.pairwise(rates)) <= 4.0 * TICK_S + 1e-6
    assert max(speed for speed, _ in drive.twists) <= 0.8 + 1e-9, "no overshoot"
    # 0.8 s at full acceleration, plus 0.25 s for its increase and decrease
    arrived = next(i for i, (speed, _) in enumerate(drive.twists) if speed > 0.8 - 1e-3)
    assert arrived * TICK_S == pytest.approx(1.05, abs=0.05)


def test_steps_are_smoothed_until_the_next_one() -> None:
    drive = Drive()
    drive.step(Command(0.5, 0.0))
    assert drive.step(Command(0.5, 0.0)).ramp_s == pytest.approx(0.02)
    assert drive.step(Command(0.5, 0.0), 0.04).ramp_s == pytest.approx(0.05)


def test_a_stop_is_limited_too_and_silence_is_not() -> None:
    drive = Drive()
    drive.run(0.8, 0.0, 2.0)
    drive.run(0.0, 0.0, 0.2)
    assert 0.0 < drive.twists[-1][0] < 0.8
    assert drive.step(SILENT) == WheelCommand(REST, None), "the documented stop"


def test_shaping_after_silence_starts_from_measured_wheel_speed() -> None:
    drive = Drive()
    drive.run(0.8, 0.0, 2.0)
    drive.step(SILENT)
    drive.wheels = WheelPair(5.0, 5.0)  # 0.5 m/s: still decelerating
    drive.step(Command(0.8, 0.0))
    assert drive.twists[-1][0] == pytest.approx(0.5, abs=0.001)


def test_frozen_engine_time_yields_no_further_step() -> None:
    drive = Drive()
    drive.run(0.8, 0.0, 0.5)
    before = drive.step(Command(0.8, 0.0))
    assert drive.step(Command(0.8, 0.0), 0.0) == before


@pytest.mark.parametrize("dt_s", [0.2, -1.0])
def test_pause_or_negative_time_restarts_from_measured_wheel_speed(dt_s: float) -> None:
    drive = Drive()
    drive.run(0.8, 0.0, 2.0)
    drive.wheels = WheelPair(3.0, 3.0)
    drive.step(Command(0.8, 0.0), dt_s)
    assert drive.twists[-1][0] == pytest.approx(0.3, abs=0.001)


def test_a_curve_stays_the_same_curve_while_it_is_taken_up() -> None:
    drive = Drive()
    drive.run(0.6, 0.9, 0.5)
    for linear_mps, angular_radps in drive.twists[2:]:
        assert angular_radps == pytest.approx(1.5 * linear_mps)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.floats(-1.5, 1.5), st.floats(-3.0, 3.0), st.integers(1, 60)), min_size=1, max_size=6))
def test_whatever_is_asked_accelerations_stay_within_their_limits(story: list[tuple[float, float, int]]) -> None:
    drive = Drive()
    for linear_mps, angular_radps, ticks in story:
        drive.run(linear_mps, angular_radps, ticks * TICK_S)
    assert max(map(abs, drive.accelerations(0))) <= 1.0 + 1e-6
    assert max(map(abs, drive.accelerations(1))) <= 2.0 + 1e-6
    drive.run(0.0, 0.0, 4.0)
    assert drive.wheels == REST
