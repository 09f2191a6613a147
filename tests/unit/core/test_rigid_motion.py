"""The rigid motion of points that lie anywhere."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.geometry import Twist2
from robot_stack.core.rigid_motion import residuals, rigid_fit

PLACES = ((0.4, 0.25), (0.3, -0.3), (-0.2, 0.15), (-0.35, -0.1))
twists = st.builds(Twist2, *[st.floats(-2.0, 2.0)] * 3)


def moved(motion: Twist2) -> list[tuple[float, float]]:
    return [(motion.vx - motion.omega * y, motion.vy + motion.omega * x) for x, y in PLACES]


@given(twists)
def test_any_two_points_or_more_give_back_the_motion(motion: Twist2) -> None:
    displacements = moved(motion)
    for points in ((0, 1, 2, 3), (0, 1), (0, 3), (1, 2), (2, 3)):
        got = rigid_fit([PLACES[i] for i in points], [displacements[i] for i in points])
        assert (got.vx, got.vy, got.omega) == pytest.approx((motion.vx, motion.vy, motion.omega), abs=1e-9)
        assert max(residuals(PLACES, displacements, got)) < 1e-9


def test_it_is_the_least_squares_solution_of_numpy() -> None:
    rng = np.random.default_rng(7)
    displacements = [(float(x), float(y)) for x, y in rng.normal(size=(4, 2))]
    rows = [row for x, y in PLACES for row in ([1.0, 0.0, -y], [0.0, 1.0, x])]
    expected = np.linalg.lstsq(np.array(rows), np.array(displacements).ravel(), rcond=None)[0]
    got = rigid_fit(PLACES, displacements)
    assert (got.vx, got.vy, got.omega) == pytest.approx(tuple(expected))
