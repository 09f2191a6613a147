"""Limits of the twist: norms, directions, jerk, braking."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.core.limits import MotionLimits
from robot_stack.core.twist_limits import approach, brake, followable_rate, limit_speed
from tests.unit.drive.robot import EMPTY, TICK_S, WITH_PASSENGER

any_finite = st.floats(allow_nan=False, allow_infinity=False)
moderate = st.floats(-1.5, 1.5)
twists = st.builds(Twist2, moderate, moderate, st.floats(-1.0, 1.0))


def close(a: Twist2, b: Twist2, tolerance: float = 1e-9) -> bool:
    return max(abs(a.vx - b.vx), abs(a.vy - b.vy), abs(a.omega - b.omega)) <= tolerance


@pytest.mark.parametrize(
    ("twist", "speed_mps", "yaw_rate_radps", "expected"),
    [
        (Twist2(3.0, 4.0, 0.5), 1.0, 1.0, Twist2(0.6, 0.8, 0.1)),
        (Twist2(1.0, 0.0, 4.0), 1.5, 1.0, Twist2(0.25, 0.0, 1.0)),
        (Twist2(1.0, 0.5, 0.2), 0.0, 1.0, ZERO_TWIST),
        (Twist2(0.0, 0.0, 0.2), 0.0, 1.0, Twist2(0.0, 0.0, 0.2)),
        (Twist2(1e308, -1e308, 0.0), 1.5, 1.0, Twist2(1.5 / math.sqrt(2), -1.5 / math.sqrt(2), 0.0)),
    ],
    ids=["norm", "stricter limit", "stop", "turn alone", "huge"],
)
def test_limit_scales_the_whole_twist(twist: Twist2, speed_mps: float, yaw_rate_radps: float, expected: Twist2):
    assert close(limit_speed(twist, speed_mps, yaw_rate_radps), expected)


@given(any_finite, any_finite, any_finite)
def test_limit_survives_huge_values(vx: float, vy: float, omega: float):
    got = limit_speed(Twist2(vx, vy, omega), 1.5, 1.0)
    assert got.is_finite()
    assert got.speed() <= 1.5 * (1 + 1e-12)
    assert abs(got.omega) <= 1.0 + 1e-12


States = list[tuple[Twist2, Twist2]]


def ride(start: Twist2, target: Twist2, limits: MotionLimits, dt_s: float = TICK_S, ticks: int = 400) -> States:
    """Returns (twist, acceleration) after each step from rest at ``start`` towards a constant target."""
    states = [(start, ZERO_TWIST)]
    for _ in range(ticks):
        twist, acceleration = states[-1]
        states.append(approach(twist, acceleration, target, ZERO_TWIST, limits, dt_s))
    return states


def assert_within(states: States, limits: MotionLimits, dt_s: float) -> None:
    slack = 1.0 + 1e-9
    for (before, a0), (after, a1) in itertools.pairwise(states):
        assert math.hypot(after.vx - before.vx, after.vy - before.vy) <= limits.acceleration_mps2 * dt_s * slack
        assert abs(after.omega - before.omega) <= limits.yaw_acceleration_radps2 * dt_s * slack
        assert math.hypot(a1.vx - a0.vx, a1.vy - a0.vy) <= limits.jerk_mps3 * dt_s * slack + 1e-9
        assert abs(a1.omega - a0.omega) <= limits.yaw_jerk_radps3 * dt_s * slack + 1e-9


@given(twists, twists, st.sampled_from([EMPTY, WITH_PASSENGER]), st.sampled_from([0.01, 0.02, 0.05, 0.1]))
@settings(deadline=None, max_examples=60)
def test_from_steady_motion_to_any_target(start: Twist2, target: Twist2, limits: MotionLimits, dt_s: float):
    """Acceleration and jerk stay within limits, along the straight line, without overshoot and in time."""
    states = ride(start, target, limits, dt_s, ticks=int(12.0 / dt_s))
    assert_within(states, limits, dt_s)
    way = Twist2(target.vx - start.vx, target.vy - start.vy, target.omega - start.omega)
    size = way.vx**2 + way.vy**2 + way.omega**2
    for twist, _ in states:
        done = Twist2(twist.vx - start.vx, twist.vy - start.vy, twist.omega - start.omega)
        share = (done.vx * way.vx + done.vy * way.vy + done.omega * way.omega) / size if size > 1e-18 else 1.0
        assert -1e-9 <= share <= 1.0 + 1e-9
        assert close(done, way.scaled(share), 1e-8)
    assert close(states[-1][0], target, 1e-9)
    assert close(states[-1][1], ZERO_TWIST, 1e-6)


@given(twists, st.lists(st.floats(0.045, 0.055), min_size=160, max_size=160))
@settings(deadline=None, max_examples=40)
def test_steps_of_uneven_length_end_exactly_at_rest(start: Twist2, steps_s: list[float]):
    """With late timers the ramp to a stop never crosses zero, ends exactly there and stays."""
    twist, acceleration = start, ZERO_TWIST
    for dt_s in steps_s:
        twist, acceleration = approach(twist, acceleration, ZERO_TWIST, ZERO_TWIST, EMPTY, dt_s)
        assert twist.vx * start.vx + twist.vy * start.vy + twist.omega * start.omega >= 0.0
    assert twist == ZERO_TWIST
    assert close(acceleration, ZERO_TWIST, 1e-6)


def test_time_of_an_s_curve():
    """0 to 1 m/s at 1 m/s2 and 2 m/s3 takes v/a + a/j = 1.5 s, within a few ticks of sampling."""
    states = ride(ZERO_TWIST, Twist2(1.0, 0.0, 0.0), EMPTY)
    arrival = next(k for k, (twist, _) in enumerate(states) if twist == Twist2(1.0, 0.0, 0.0))
    assert 1.4 <= arrival * TICK_S <= 1.75


@given(st.lists(twists, min_size=2, max_size=8), st.sampled_from([EMPTY, WITH_PASSENGER]))
@settings(deadline=None, max_examples=60)
def test_targets_that_jump_at_any_time(targets: list[Twist2], limits: MotionLimits):
    """Acceleration never exceeds its limit and increases no faster than the jerk. (Its decrease is not limited.)"""
    twist = acceleration = ZERO_TWIST
    for k in range(len(targets) * 9):
        before = acceleration
        twist, acceleration = approach(twist, acceleration, targets[k // 9], ZERO_TWIST, limits, TICK_S)
        slack = 1.0 + 1e-9
        assert math.hypot(acceleration.vx, acceleration.vy) <= limits.acceleration_mps2 * slack
        assert abs(acceleration.omega) <= limits.yaw_acceleration_radps2 * slack
        # In the norm used for dropping a part (1 m per rad for this robot) dropping only reduces it.
        gain = _size(acceleration) - _size(before)
        assert gain <= math.hypot(limits.jerk_mps3, limits.yaw_jerk_radps3) * TICK_S * slack
        assert twist.is_finite()


def _size(acceleration: Twist2) -> float:
    return math.hypot(acceleration.vx, acceleration.vy, acceleration.omega)


def test_slower_target_never_raises_speed_first():
    twist, acceleration = ZERO_TWIST, ZERO_TWIST
    for _ in range(14):
        twist, acceleration = approach(twist, acceleration, Twist2(1.5, 0.0, 0.0), ZERO_TWIST, EMPTY, TICK_S)
    assert acceleration.vx == pytest.approx(1.0)
    slower, _ = approach(twist, acceleration, Twist2(0.2, 0.0, 0.0), ZERO_TWIST, EMPTY, TICK_S)
    assert slower.vx < twist.vx


def test_moving_target_within_the_limits_is_followed_without_lag():
    """A sampled, jerk-limited target: after one second every step ends on it."""

    def speed(t_s: float) -> float:
        return 0.5 - 0.5 * math.cos(t_s)  # at most 0.5 m/s2 and 0.5 m/s3

    twist = acceleration = ZERO_TWIST
    worst = 0.0
    for k in range(200):
        t_s = k * TICK_S
        rate = Twist2((speed(t_s) - speed(t_s - TICK_S)) / TICK_S, 0.0, 0.0)
        twist, acceleration = approach(twist, acceleration, Twist2(speed(t_s), 0.0, 0.0), rate, EMPTY, TICK_S)
        if t_s > 1.0:
            worst = max(worst, abs(twist.vx - speed(t_s + TICK_S)))
    assert worst < 0.002


def test_followable_rate():
    assert followable_rate(Twist2(0.5, 0.0, 0.0), EMPTY) == Twist2(0.5, 0.0, 0.0)
    assert followable_rate(Twist2(1.2, 0.0, 0.0), EMPTY) == Twist2(1.0, 0.0, 0.0)
    assert followable_rate(Twist2(20.0, 0.0, 0.0), EMPTY) == ZERO_TWIST


@given(twists)
def test_braking_keeps_the_path(twist: Twist2):
    """At 2.0 m/s2 and 4.0 rad/s2, of which the one that takes longer is used in full."""
    after = brake(twist, 2.0, 4.0, TICK_S)
    moving = twist.speed() > 1e-9
    factor = after.speed() / twist.speed() if moving else after.omega / twist.omega if twist.omega else 0.0
    assert 0.0 <= factor <= 1.0
    assert close(after, twist.scaled(factor), 1e-9)
    assert twist.speed() - after.speed() <= 2.0 * TICK_S + 1e-9
    assert abs(twist.omega) - abs(after.omega) <= 4.0 * TICK_S + 1e-9
    assert brake(Twist2(1.0, 0.0, 0.0), 2.0, 4.0, TICK_S).vx == pytest.approx(0.9)
    assert brake(Twist2(0.1, 0.0, 0.0), 2.0, 4.0, TICK_S) == ZERO_TWIST
