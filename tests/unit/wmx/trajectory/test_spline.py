"""The clamped spline compared with values computed by hand, and its peaks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.wmx.trajectory.spline import ClampedSpline


def test_two_points_are_a_cubic_from_rest_to_rest() -> None:
    spline = ClampedSpline(np.array([0.0, 2.0]), np.array([[0.0, 1.0], [4.0, 1.0]]))
    position, velocity, acceleration = spline.evaluate(1.0)
    assert position == pytest.approx([2.0, 1.0])
    assert velocity == pytest.approx([3.0, 0.0])  # 1.5 times the mean of 2 rad/s
    assert acceleration == pytest.approx([0.0, 0.0])
    assert spline.max_speed() == pytest.approx([3.0, 0.0])
    assert spline.max_acceleration() == pytest.approx([6.0, 0.0])  # 6 * 4 / 2^2
    assert spline.duration_s == 2.0


def test_outside_it_stands() -> None:
    spline = ClampedSpline(np.array([1.0, 2.0]), np.array([[0.0], [4.0]]))
    for time_s, place in ((0.0, 0.0), (1.0, 0.0), (2.0, 4.0), (9.0, 4.0)):
        position, velocity, acceleration = spline.evaluate(time_s)
        assert (position[0], velocity[0], acceleration[0]) == (place, 0.0, 0.0)


@settings(max_examples=20, deadline=None)
@given(st.integers(2, 30), st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_peaks_are_those_of_a_fine_sampling(n: int, joints: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    times = np.concatenate([[0.0], np.cumsum(random.uniform(0.01, 1.0, n - 1))])
    spline = ClampedSpline(times, random.uniform(-3.0, 3.0, (n, joints)))
    samples = [spline.evaluate(float(at)) for at in np.linspace(0.0, times[-1], 100 * n)]
    fine = np.abs([velocity for _, velocity, _ in samples]).max(axis=0)
    assert (spline.max_speed() >= fine * (1.0 - 1e-9)).all()
    assert spline.max_speed() == pytest.approx(fine, rel=0.05, abs=1e-6)
    steep = np.abs([acceleration for _, _, acceleration in samples]).max(axis=0)
    assert (spline.max_acceleration() >= steep * (1.0 - 1e-9)).all()
