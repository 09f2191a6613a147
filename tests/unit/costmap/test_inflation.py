"""Costs by distance: Nav2's values, and distances compared with every pair of cells."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from robot_stack.core.robot import load_robot
from robot_stack.costmap.inflation import cost, cost_table, inflated

ROBOT = load_robot()


def test_radii_of_both_footprints() -> None:
    assert ROBOT.footprint.inscribed_m() == 0.35
    assert ROBOT.footprint.circumscribed_m() == pytest.approx(math.hypot(0.5, 0.35))
    assert ROBOT.footprint_with_chair.inscribed_m() == 0.40
    assert ROBOT.footprint_with_chair.circumscribed_m() == pytest.approx(math.hypot(1.4, 0.4))


@pytest.mark.parametrize(
    ("distance_m", "expected"),
    [
        (0.0, 100),
        (0.05, 99),
        (0.35, 99),
        # 252 exp(-3 * 0.1) = 186.7: 1 + 97 * 185 // 251 = 72
        (0.45, 72),
        # 252 exp(-3 * 1.0) = 12.5: 1 + 97 * 11 // 251 = 5
        (1.35, 5),
        (0.35 + math.log(252.0 / 0.99) / 3.0, 0),
    ],
)
def test_cost_by_hand(distance_m: float, expected: int) -> None:
    assert cost(distance_m, 0.35, 3.0) == expected


@given(st.floats(0.0, 3.0), st.floats(0.0, 3.0))
def test_farther_never_costs_more(a: float, b: float) -> None:
    assert cost(max(a, b), 0.35, 3.0) <= cost(min(a, b), 0.35, 3.0)


def test_the_table_ends_at_the_inflation_radius() -> None:
    table = cost_table(ROBOT.footprint, 0.25, 3.0, 0.05)
    reach = (math.hypot(0.5, 0.35) + 0.25) / 0.05
    assert len(table) == int(reach * reach) + 1
    assert (table[0], table[49]) == (100, 99)  # 7 cells are the inscribed radius
    assert table[50] == 96  # sqrt(50) cells are 0.3536 m: 252 exp(-0.0107) = 249, 1 + 97 * 248 // 251
    assert table[-1] > 0


@settings(max_examples=40)
@given(
    hnp.arrays(np.int8, hnp.array_shapes(min_dims=2, max_dims=2, max_side=14), elements=st.sampled_from([-1, 0, 100]))
)
def test_every_cell_has_the_cost_of_its_nearest_obstacle(state: np.ndarray) -> None:
    costs = np.array([100, 99, 99, 0, 80, 60, 0, 0, 40, 20], np.int8)
    out = inflated(state, costs)
    occupied = np.argwhere(state == 100)
    for row, column in np.ndindex(*state.shape):
        squared = min((int((r - row) ** 2 + (c - column) ** 2) for r, c in occupied), default=10**6)
        expected = int(costs[squared]) if squared < len(costs) else 0
        if state[row, column] == -1 and expected < 99:
            expected = -1
        assert out[row, column] == expected
