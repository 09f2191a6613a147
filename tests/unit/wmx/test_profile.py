"""Motion profiles: values computed by hand, then properties for any command from any state of motion."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from robot_stack.wmx.engine_server.profile import (
    MAX_SEGMENTS,
    OVERTRAVEL_CHANGE_DECELERATION,
    OVERTRAVEL_CHANGE_INITIAL_VELOCITY,
    OVERTRAVEL_DISABLED,
    evaluate,
    plan_position,
    plan_stop,
    plan_velocity,
    remaining,
)

Plan = NDArray[np.float64]

positions = st.floats(-100.0, 100.0)
speeds = st.floats(1e-3, 30.0)
velocities = st.just(0.0) | speeds | speeds.map(lambda speed: -speed)
limits = st.floats(0.01, 30.0)
rates = st.floats(0.1, 500.0)
overtravels = st.sampled_from([OVERTRAVEL_DISABLED, OVERTRAVEL_CHANGE_DECELERATION, OVERTRAVEL_CHANGE_INITIAL_VELOCITY])


def empty() -> Plan:
    return np.full((MAX_SEGMENTS, 4), math.nan)


def sample(plan: Plan, n: int, count: int = 400) -> list[tuple[float, float, float, float]]:
    """Returns (time, position, velocity, acceleration) over the whole plan."""
    end = plan[n - 1, 0] if n else 0.0
    return [(t, *evaluate(plan, n, t)[:3]) for t in np.linspace(0.0, end, count, endpoint=False)]


class TestByHand:
    def test_trapezoid(self) -> None:
        # 10 rad at 2 rad/s with 1 and 2 rad/s2: ramps 2 s / 2 rad and 1 s / 1 rad, cruise 7 rad in 3.5 s.
        plan = empty()
        n = plan_position(plan, 0.0, 0.0, 10.0, 2.0, 1.0, 2.0, OVERTRAVEL_CHANGE_DECELERATION)
        assert n == 3
        assert plan[:3, 0] == pytest.approx([2.0, 5.5, 6.5])
        assert evaluate(plan, n, 1.0)[:3] == pytest.approx((0.5, 1.0, 1.0))
        assert evaluate(plan, n, 3.0)[:3] == pytest.approx((4.0, 2.0, 0.0))
        assert evaluate(plan, n, 6.0)[:3] == pytest.approx((9.75, 1.0, -2.0))
        assert evaluate(plan, n, 6.5) == pytest.approx((10.0, 0.0, 0.0, True))
        assert remaining(plan, n, 6.0) == pytest.approx(0.5)
        assert remaining(plan, n, 99.0) == 0.0

    def test_short_way_is_a_triangle(self) -> None:
        # 1 rad with 1 rad/s2 both ways never reaches 5 rad/s: peak 1 rad/s after 1 s.
        plan = empty()
        n = plan_position(plan, 0.0, 0.0, -1.0, 5.0, 1.0, 1.0, OVERTRAVEL_CHANGE_DECELERATION)
        assert n == 2
        assert evaluate(plan, n, 1.0)[:2] == pytest.approx((-0.5, -1.0))
        assert plan[1, 0] == pytest.approx(2.0)

    def test_above_its_limit_it_brakes_first(self) -> None:
        # From 4 rad/s to a limit of 2 rad/s at 2 rad/s2: 1 s and 3 rad; then cruise; then 1 rad to rest.
        plan = empty()
        n = plan_position(plan, 0.0, 4.0, 10.0, 2.0, 1.0, 2.0, OVERTRAVEL_CHANGE_DECELERATION)
        assert plan[:n, 0] == pytest.approx([1.0, 4.0, 5.0])
        assert evaluate(plan, n, 1.0)[:2] == pytest.approx((3.0, 2.0))

    def test_moving_away_it_turns_round(self) -> None:
        # At -2 rad/s with 1 rad/s2: rest at -2 after 2 s, then 4 rad to +2 at up to 2 rad/s.
        plan = empty()
        n = plan_position(plan, 0.0, -2.0, 2.0, 2.0, 1.0, 1.0, OVERTRAVEL_CHANGE_DECELERATION)
        assert evaluate(plan, n, 2.0)[:2] == pytest.approx((-2.0, 0.0))
        assert evaluate(plan, n, 99.0)[0] == pytest.approx(2.0)

    def test_too_late_to_stop(self) -> None:
        # 2 rad/s needs 2 rad at 1 rad/s2 and has 1.
        plan = empty()
        n = plan_position(plan, 0.0, 2.0, 1.0, 5.0, 1.0, 1.0, OVERTRAVEL_CHANGE_DECELERATION)
        assert n == 1
        assert plan[0].tolist() == pytest.approx([1.0, 0.0, 2.0, -2.0])
        n = plan_position(plan, 0.0, 2.0, 1.0, 5.0, 1.0, 1.0, OVERTRAVEL_CHANGE_INITIAL_VELOCITY)
        assert evaluate(plan, n, 0.0)[1] == pytest.approx(math.sqrt(2.0))
        n = plan_position(plan, 0.0, 2.0, 1.0, 5.0, 1.0, 1.0, OVERTRAVEL_DISABLED)
        assert evaluate(plan, n, 2.0)[:2] == pytest.approx((2.0, 0.0)), "overshoots to 2 and comes back"
        assert evaluate(plan, n, 99.0)[0] == pytest.approx(1.0)

    def test_velocity_through_zero(self) -> None:
        # From 2 to -3 rad/s: falls at 4 for 0.5 s, grows at 2 for 1.5 s.
        plan = empty()
        n = plan_velocity(plan, 0.0, 2.0, -3.0, 2.0, 4.0)
        assert plan[:n, 0] == pytest.approx([0.5, 2.0, math.inf])
        assert evaluate(plan, n, 0.5)[:2] == pytest.approx((0.5, 0.0))
        assert evaluate(plan, n, 2.0)[:2] == pytest.approx((0.5 - 2.25, -3.0))
        assert evaluate(plan, n, 3.0)[:2] == pytest.approx((0.5 - 2.25 - 3.0, -3.0))
        assert math.isinf(remaining(plan, n, 3.0))


class TestProperties:
    # A distance so short that no deceleration stops within it.
    @example(start=0.0, speed=1.0, target=2.2e-313, limit=1.0, acc=1.0, dec=1.0, overtravel=1)
    @settings(max_examples=150, deadline=None)
    @given(positions, velocities, positions, limits, rates, rates, overtravels)
    def test_position_plan_arrives(
        self, start: float, speed: float, target: float, limit: float, acc: float, dec: float, overtravel: int
    ) -> None:
        plan = empty()
        n = plan_position(plan, start, speed, target, limit, acc, dec, overtravel)
        assert 0 <= n <= MAX_SEGMENTS
        if n:
            end, velocity, acceleration, ended = evaluate(plan, n, plan[n - 1, 0])
            assert end == pytest.approx(target, abs=1e-6)
            assert (velocity, acceleration, ended) == (0.0, 0.0, True)
        else:
            assert target == pytest.approx(start, abs=1e-9)
        assert np.isfinite(plan[:n]).all()
        assert (np.diff(plan[:n, 0], prepend=0.0) > 0.0).all()

    @settings(max_examples=150, deadline=None)
    @given(positions, velocities, positions, limits, rates, rates, overtravels)
    def test_position_plan_keeps_its_limits(
        self, start: float, speed: float, target: float, limit: float, acc: float, dec: float, overtravel: int
    ) -> None:
        plan = empty()
        n = plan_position(plan, start, speed, target, limit, acc, dec, overtravel)
        for _, _, velocity, acceleration in sample(plan, n):
            assert abs(velocity) <= max(limit, abs(speed)) * (1.0 + 1e-9)
            if overtravel != OVERTRAVEL_CHANGE_DECELERATION or n > 1:
                growing = velocity * acceleration > 0.0
                allowed = acc if growing else dec if velocity else max(acc, dec)
                assert abs(acceleration) <= allowed * (1.0 + 1e-9)

    @settings(max_examples=150, deadline=None)
    @given(positions, velocities, positions, limits, rates, rates)
    def test_braking_harder_happens_only_when_needed_and_just_enough(
        self, start: float, speed: float, target: float, limit: float, acc: float, dec: float
    ) -> None:
        plan = empty()
        n = plan_position(plan, start, speed, target, limit, acc, dec, OVERTRAVEL_CHANGE_DECELERATION)
        hardest = max((abs(a) for _, _, v, a in sample(plan, n) if v * a < 0.0), default=0.0)
        distance = target - start
        too_late = speed * distance > 0.0 and speed * speed / (2.0 * dec) > abs(distance) * (1.0 + 1e-6)
        if hardest > dec * (1.0 + 1e-6):
            assert too_late
            assert hardest == pytest.approx(speed * speed / (2.0 * abs(distance)), rel=1e-6)

    @settings(max_examples=150, deadline=None)
    @given(positions, velocities, positions, limits, rates, rates, overtravels)
    def test_position_plan_is_continuous(
        self, start: float, speed: float, target: float, limit: float, acc: float, dec: float, overtravel: int
    ) -> None:
        plan = empty()
        n = plan_position(plan, start, speed, target, limit, acc, dec, overtravel)
        if n and overtravel != OVERTRAVEL_CHANGE_INITIAL_VELOCITY:
            assert plan[0, 2] == pytest.approx(speed, abs=1e-9), "no step of velocity at the override"
        for k in range(n - 1):
            duration = plan[k, 0] - (plan[k - 1, 0] if k else 0.0)
            position = plan[k, 1] + (plan[k, 2] + 0.5 * plan[k, 3] * duration) * duration
            assert plan[k + 1, 1] == pytest.approx(position, abs=1e-6)
            assert plan[k + 1, 2] == pytest.approx(plan[k, 2] + plan[k, 3] * duration, abs=1e-6)

    @settings(max_examples=150, deadline=None)
    @given(positions, velocities, velocities, st.just(0.0) | rates, st.just(0.0) | rates)
    def test_velocity_plan(self, start: float, speed: float, wanted: float, acc: float, dec: float) -> None:
        plan = empty()
        n = plan_velocity(plan, start, speed, wanted, acc, dec)
        assert 1 <= n <= 3
        assert math.isinf(plan[n - 1, 0])
        assert plan[n - 1, 2] == wanted
        assert plan[n - 1, 3] == 0.0
        lowest, highest = min(speed, wanted), max(speed, wanted)
        for k in range(n - 1):
            start_of = plan[k - 1, 0] if k else 0.0
            for t in np.linspace(start_of, plan[k, 0], 20, endpoint=False):
                _, velocity, acceleration, ended = evaluate(plan, n, t)
                assert not ended
                assert lowest - 1e-9 <= velocity <= highest + 1e-9, "monotonic between the two velocities"
                growing = velocity * acceleration > 0.0
                allowed = [acc if growing else dec] if velocity else [acc, dec]
                assert abs(acceleration) in [pytest.approx(rate) for rate in allowed]

    @settings(max_examples=100, deadline=None)
    @given(positions, velocities, rates)
    def test_stop_plan(self, start: float, speed: float, dec: float) -> None:
        plan = empty()
        n = plan_stop(plan, start, speed, dec)
        if speed == 0.0:
            assert n == 0
            return
        assert plan[0, 0] == pytest.approx(abs(speed) / dec)
        end, velocity, _, ended = evaluate(plan, n, math.inf)
        assert n == 1
        assert ended
        assert velocity == 0.0
        assert end == pytest.approx(start + speed * abs(speed) / (2.0 * dec), abs=1e-6)

    @settings(max_examples=100, deadline=None)
    @given(*[st.floats(allow_nan=False, allow_infinity=False, min_value=-1e9, max_value=1e9)] * 3, overtravels)
    def test_extreme_but_legal_numbers_stay_finite(
        self, start: float, speed: float, target: float, overtravel: int
    ) -> None:
        plan = empty()
        for limit, acc, dec in ((1e-6, 1e-6, 1e-6), (2.7e11, 2.7e11, 2.7e11), (1e-6, 2.7e11, 1e-6)):
            n = plan_position(plan, start, speed, target, limit, acc, dec, overtravel)
            assert np.isfinite(plan[:n]).all()
            assert all(math.isfinite(x) for x in evaluate(plan, n, 1.0)[:3]) or n == 0
            n = plan_velocity(plan, start, speed, -speed, acc, dec)
            assert np.isfinite(plan[:n, 1:]).all()
