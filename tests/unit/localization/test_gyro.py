"""Angles from gyro samples."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.localization.gyro import GyroIntegrator, ImuSample
from tests.unit.localization.stories import params


def sample(stamp_s: float, rate: float) -> ImuSample:
    return ImuSample(stamp_s, rate, (stamp_s, rate))


def integrator() -> GyroIntegrator:
    return GyroIntegrator(params().gyro)


def test_constant_rate() -> None:
    gyro = integrator()
    for i in range(11):
        gyro.add(sample(i * 0.01, 0.5))
    assert gyro.take(0.0) is None  # the first call only sets the start
    increment = gyro.take(0.1)
    assert increment.angle_rad == pytest.approx(0.05)
    # Noise of 0.003 rad/s per sample of 10 ms over 0.1 s: 0.003^2 * 0.01 * 0.1.
    assert increment.variance_rad2 == pytest.approx(9e-9)


def test_a_sample_is_the_mean_since_the_one_before() -> None:
    gyro = integrator()
    gyro.add(sample(0.0, 9.0))
    gyro.add(sample(0.01, 1.0))
    gyro.add(sample(0.02, 3.0))
    gyro.take(0.005)
    increment = gyro.take(0.015)
    assert increment.angle_rad == pytest.approx(1.0 * 0.005 + 3.0 * 0.005)


def test_a_held_rate_is_made_good_by_the_next_increment() -> None:
    gyro = integrator()
    gyro.add(sample(0.0, 0.0))
    gyro.add(sample(0.01, 1.0))
    gyro.take(0.0)
    first = gyro.take(0.02)  # held at 1.0 from 0.01 on
    gyro.add(sample(0.02, 3.0))
    gyro.add(sample(0.03, 3.0))
    second = gyro.take(0.03)
    assert first.angle_rad == pytest.approx(0.01 + 0.01)
    # The same total as with the third sample in time: (1 + 3 + 3) * 0.01.
    assert first.angle_rad + second.angle_rad == pytest.approx(0.07)


def test_gyro_gap_returns_none_then_resumes() -> None:
    gyro = integrator()
    gyro.add(sample(0.0, 1.0))
    gyro.add(sample(0.01, 1.0))
    gyro.take(0.01)
    assert gyro.take(0.2) is None
    gyro.add(sample(0.3, 1.0))
    gyro.add(sample(0.31, 1.0))
    assert gyro.take(0.3) is None
    increment = gyro.take(0.31)
    assert increment.angle_rad == pytest.approx(0.01)
    gyro.add(sample(0.81, 1.0))
    assert gyro.take(0.81) is None  # across a gap of the samples


def test_lost_samples_cost_certainty() -> None:
    gyro = integrator()
    gyro.add(sample(0.0, 0.5))
    gyro.add(sample(0.06, 0.5))
    gyro.take(0.0)
    increment = gyro.take(0.06)
    assert increment.angle_rad == pytest.approx(0.03)
    # Samples of 60 ms less one and a half periods are missing: 1 rad/s2 over 45 ms turns 0.5 * 0.045^2 rad.
    assert increment.variance_rad2 == pytest.approx((0.5 * 0.045**2) ** 2 + 0.003**2 * 0.01 * 0.06)


def test_equal_samples_are_a_frozen_sensor() -> None:
    gyro = integrator()
    for i in range(11):
        assert gyro.add(ImuSample(i * 0.01, 0.1, (0.1, 9.81))) == "" or i == 10
    assert gyro.frozen
    assert gyro.take(0.1) is None
    assert gyro.add(ImuSample(0.11, 0.1, (0.1, 9.82))) == ""
    assert not gyro.frozen


@pytest.mark.parametrize(("rate", "word"), [(math.nan, "not finite"), (math.inf, "not finite"), (11.0, "limit of 10")])
def test_bad_rates_are_refused_by_name(rate: float, word: str) -> None:
    assert word in integrator().add(sample(0.0, rate))


def test_one_late_sample_is_dropped_but_a_clock_set_back_is_followed() -> None:
    gyro = integrator()
    gyro.add(sample(50.0, 0.0))
    assert "stamp" in gyro.add(sample(49.99, 0.0))
    for i in range(20):
        gyro.add(sample(1.0 + 0.01 * i, 0.2))
    gyro.take(1.15)
    increment = gyro.take(1.19)
    assert increment.angle_rad == pytest.approx(0.2 * 0.04)


def test_gyro_noise_is_estimated_from_second_differences() -> None:
    gyro = integrator()
    for i in range(300):
        gyro.add(sample(0.01 * i, 0.2 if i % 2 else -0.2))
    # Second differences of +-0.8 rad/s: sqrt(0.64 / 6) = 0.327 rad/s.
    assert gyro.noise_radps == pytest.approx(0.327, rel=0.02)
    gyro = integrator()
    for i in range(300):
        gyro.add(sample(0.01 * i, math.sin(0.01 * i * 4.0)))
    assert gyro.noise_radps == pytest.approx(0.003), "a fast, but smooth turn"


@given(st.lists(st.floats(-5.0, 5.0), min_size=20, max_size=60), st.data())
def test_increments_add_up_however_time_is_cut(rates: list[float], data: st.DataObject) -> None:
    gyro = integrator()
    for i, rate in enumerate(rates):
        gyro.add(ImuSample(0.01 * i, rate, (i, rate)))
    end_s = 0.01 * (len(rates) - 1)
    cuts = sorted(data.draw(st.lists(st.floats(0.0, end_s), max_size=8)))
    whole = 0.01 * sum(rates[1:])
    gyro.take(0.0)
    parts = [gyro.take(cut) for cut in [*cuts, end_s]]
    assert all(part is not None for part in parts)
    assert sum(part.angle_rad for part in parts if part) == pytest.approx(whole, abs=1e-9)
