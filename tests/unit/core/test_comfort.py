"""Comfort at the seat: the weightings of ISO 2631-1, the lever arm, and jerk."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from robot_stack.core.comfort import Comfort, ComfortMeter, load_seat, wd, wk

SEAT = (1.5, 0.0, 0.5)
GRAVITY = 9.81
Motion = Callable[[float], tuple[float, float, float]]


def still(_: float) -> tuple[float, float, float]:
    return 0.0, 0.0, 0.0


def ridden(acceleration: Motion = still, rotation: Motion = still, duration_s: float = 30.0) -> Comfort | None:
    meter = ComfortMeter(SEAT)
    for count in range(round(100.0 * duration_s)):
        at_s = 0.01 * count
        x, y, z = acceleration(at_s)
        meter.add(1e6 + at_s, (x, y, z + GRAVITY), rotation(at_s), moves=True)
    return meter.comfort()


def test_the_duration_counts_each_stretch_between_two_stops() -> None:
    meter = ComfortMeter(SEAT)
    for count in range(2400):  # 6 s of motion, 2 s of rest
        meter.add(0.01 * count, (0.0, 0.0, GRAVITY), (0.0, 0.0, 0.0), moves=count % 800 < 600)
    comfort = meter.comfort()
    assert comfort is not None
    assert comfort.duration_s == pytest.approx(3 * 5.12)


@pytest.mark.parametrize(
    ("frequency_hz", "vertical", "horizontal"),
    [
        (0.5, 0.418, 0.853),
        (1.0, 0.482, 1.011),
        (2.0, 0.531, 0.890),
        (4.0, 0.967, 0.512),
        (8.0, 1.036, 0.253),
        (16.0, 0.768, 0.125),
        (31.5, 0.405, 0.063),
    ],
)
def test_the_weightings_are_those_of_the_standard(frequency_hz: float, vertical: float, horizontal: float) -> None:
    """ISO 2631-1:1997 Table 3, whose upper band limit of 100 Hz takes 0.5 % at 31.5 Hz."""
    at = np.array([frequency_hz])
    assert wk(at)[0] == pytest.approx(vertical, rel=0.02)
    assert wd(at)[0] == pytest.approx(horizontal, rel=0.02)


def test_a_vertical_vibration_is_weighted() -> None:
    frequency_hz = 4.0
    found = ridden(lambda at_s: (0.0, 0.0, math.sqrt(2.0) * math.sin(math.tau * frequency_hz * at_s)))
    assert found is not None
    assert found.weighted_mps2[2] == pytest.approx(float(wk(np.array([frequency_hz]))[0]), rel=0.02)
    assert found.weighted_mps2[0] < 1e-6
    assert found.total_mps2 == pytest.approx(found.weighted_mps2[2])


def test_gravity_and_an_even_acceleration_are_no_vibration() -> None:
    found = ridden(lambda _: (0.3, 0.0, 0.0))
    assert found is not None
    assert found.total_mps2 < 1e-6
    assert found.jerk_p99_mps3 <= 0.05


def test_a_pitching_robot_lifts_the_seat() -> None:
    """At 2 Hz, 0.1 rad/s amplitude: rotational acceleration 1.26 rad/s2, 1.5 m away."""
    found = ridden(rotation=lambda at_s: (0.0, 0.1 * math.sin(math.tau * 2.0 * at_s), 0.0))
    assert found is not None
    rotational = 0.1 * math.tau * 2.0
    assert found.weighted_mps2[2] == pytest.approx(0.531 * 1.5 * rotational / math.sqrt(2.0), rel=0.03)
    assert found.weighted_mps2[0] == pytest.approx(0.890 * 0.5 * rotational / math.sqrt(2.0), rel=0.03)


def test_the_jerk_of_a_steady_change_is_its_slope() -> None:
    found = ridden(lambda at_s: (0.8 * abs(math.remainder(at_s, 10.0)), 0.0, 0.0))
    assert found is not None
    assert found.jerk_p99_mps3 == pytest.approx(0.8, abs=0.06)


def test_only_unbroken_motion_counts() -> None:
    """Stops, invalid values and a step of the clock begin a new block."""
    meter = ComfortMeter(SEAT)
    for count in range(3000):
        at_s = 0.01 * count
        meter.add(at_s, (math.sin(30.0 * at_s), 0.0, GRAVITY), (0.0, 0.0, 0.0), moves=count % 500 < 400)
    assert meter.comfort() is None
    for count in range(1000):
        meter.add(100.0 + 0.01 * count, (math.nan, 0.0, GRAVITY), (0.0, 0.0, 0.0), moves=True)
    assert meter.comfort() is None
    for count in range(800):
        stamp_s = 200.0 + 0.01 * count + (3600.0 if count >= 400 else 0.0)
        meter.add(stamp_s, (0.0, 0.0, GRAVITY), (0.0, 0.0, 0.0), moves=True)
    assert meter.comfort() is None
    x, y, z = load_seat()
    assert (x, abs(y), z) == (pytest.approx(1.4, abs=0.5), pytest.approx(0.0, abs=1e-9), 0.5)
