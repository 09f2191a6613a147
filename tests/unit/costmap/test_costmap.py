"""The costmap computed from the space around the robot."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.core.config import load
from robot_stack.core.robot import load_robot
from robot_stack.costmap.costmap import LocalCostmap, Space, space_problem
from robot_stack.costmap.params import CostmapParams

PARAMS = load(CostmapParams, "costmap_server")
RESOLUTION_M = 0.05


def space() -> Space:
    """10 m by 10 m, free, with a wall at x = 2 m for |y| < 0.5 m and unseen space behind it; (0, 0) is the centre."""
    state = np.zeros((200, 200), np.int8)
    state[90:110, 141:] = -1
    state[90:110, 140] = 100
    return Space(state, RESOLUTION_M)


def at(costs: np.ndarray, x_m: float, y_m: float) -> int:
    return int(costs[math.floor(y_m / RESOLUTION_M) + 100, math.floor(x_m / RESOLUTION_M) + 100])


def test_a_wall_its_inflation_and_its_shadow() -> None:
    costs = LocalCostmap(PARAMS, load_robot()).costs(space())
    assert costs.shape == (200, 200)
    assert costs.dtype == np.int8
    assert at(costs, 2.02, 0.0) == 100
    assert at(costs, 1.80, 0.0) == 99
    assert 0 < at(costs, 1.40, 0.0) < 99
    assert at(costs, 1.0, 0.0) == 0
    assert at(costs, 2.20, 0.0) == 99  # unseen, but within the inscribed radius of the wall
    assert at(costs, 4.0, 0.0) == -1
    assert at(costs, 2.02, -2.0) == 0


def test_the_footprint_in_force_inflates() -> None:
    costmap = LocalCostmap(PARAMS, load_robot())
    assert 0 < at(costmap.costs(space()), 2.0 - 0.385, 0.0) < 99
    costmap.chair = True
    assert at(costmap.costs(space()), 2.0 - 0.385, 0.0) == 99
    costmap.chair = False
    assert 0 < at(costmap.costs(space()), 2.0 - 0.385, 0.0) < 99


def test_the_space_stays_as_it_is() -> None:
    given = space()
    LocalCostmap(PARAMS, load_robot()).costs(given)
    np.testing.assert_array_equal(given.state, space().state)


@pytest.mark.parametrize(
    ("resolution_m", "size", "cell", "problem"),
    [
        (0.05, (200, 200), 0, ""),
        (0.0, (200, 200), 0, "info.resolution is 0.0"),
        (math.nan, (200, 200), 0, "info.resolution is nan"),
        (0.05, (200, 100), 0, "data has 40000 cells, must be 200 x 100"),
        (0.05, (0, 0), 0, "data has 40000 cells, must be 0 x 0"),
        (0.05, (200, 200), 50, "data has other cells than -1, 0, 100"),
    ],
)
def test_invalid_space_grid_is_reported(resolution_m: float, size: tuple[int, int], cell: int, problem: str) -> None:
    state = space().state
    state[0, 0] = cell
    found = space_problem(Space(state, resolution_m), size)
    assert found.startswith(problem)
    assert bool(found) == bool(problem)
