"""Ground, kerbs, ramps and drop-offs on the grid, and moving objects."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.core.config import load
from robot_stack.core.site_map import FREE, OCCUPIED, UNKNOWN
from robot_stack.mapping.grid import driven_cells, grid_of
from robot_stack.mapping.ground import bins_of, surface_of
from robot_stack.mapping.moving_objects import Votes
from robot_stack.mapping.params import MappingParams

PARAMS = load(MappingParams, "mapping")
SLOPE = np.tan(np.radians(10.0))


def height(x, y):
    """Returns the height of a yard of 8 x 7.5 m. At x = 4: a kerb 15 cm wide, 5 cm high; x > 5: a platform 6 cm
    high; y > 4: a pit of 30 cm; y < 1: a ramp of 10 deg up to 0.5 m that ends in a drop.
    """
    z = np.zeros_like(x)
    z[(x > 4.0) & (x < 4.15) & (y > 1.0)] = 0.05
    z[(x > 5.0) & (y > 1.0)] = 0.06
    z[y > 4.0] = -0.30
    ramp = (y < 1.0) & (x > 1.0)
    z[ramp] = np.minimum(SLOPE * (x[ramp] - 1.0), 0.5)
    return z


@pytest.fixture(scope="module")
def grid():
    random = np.random.default_rng(5)
    x, y = random.uniform(0.0, 8.0, 500_000), random.uniform(-1.5, 6.0, 500_000)
    z = height(x, y) + random.normal(0.0, 0.02, len(x))
    unseen = (x < 0.5) & (y > 2.0)
    ground = np.stack([x, y, z], axis=1)[~unseen]
    post = random.uniform([2.0, 2.0, 0.0], [2.1, 2.1, 1.5], (400, 3))
    ceiling = random.uniform([1.0, 3.0, 2.4], [3.0, 3.6, 2.5], (5000, 3))
    bins = bins_of([ground, post, ceiling], PARAMS.grid.resolution_m)
    way = np.stack([np.linspace(1.0, 3.5, 26), np.full(26, 1.5), np.zeros(26)], axis=1)
    surface = surface_of(bins, way, PARAMS.grid)
    poses = np.tile(np.eye(4), (26, 1, 1))
    poses[:, :3, 3] = way
    return grid_of(bins, surface, driven_cells(surface, poses, 0.2, 0.2), PARAMS.grid)


def share(grid, value: int, x0: float, x1: float, y0: float, y1: float) -> float:
    rows = slice(round((y0 - grid.origin_y_m) / 0.1), round((y1 - grid.origin_y_m) / 0.1))
    columns = slice(round((x0 - grid.origin_x_m) / 0.1), round((x1 - grid.origin_x_m) / 0.1))
    return float((grid.occupancy[rows, columns] == value).mean())


def test_open_ground_is_free_and_unobserved_space_is_unknown(grid):
    assert share(grid, FREE, 0.6, 3.7, 1.3, 1.9) == 1.0
    assert share(grid, FREE, 1.0, 3.0, 3.0, 3.6) == 1.0, "a ceiling is no obstacle"
    assert share(grid, UNKNOWN, 0.0, 0.4, 2.2, 3.6) == 1.0


def test_kerb_platform_and_side_of_a_ramp_are_occupied_without_gap(grid):
    for y in np.arange(1.4, 3.6, 0.1):
        assert share(grid, OCCUPIED, 3.9, 4.3, y, y + 0.1) > 0.0, f"a hole in the kerb at y = {y:.1f}"
        assert share(grid, OCCUPIED, 4.8, 5.2, y, y + 0.1) > 0.0, f"a hole in the step at y = {y:.1f}"
    for x in np.arange(2.0, 3.6, 0.1):
        assert share(grid, OCCUPIED, x, x + 0.1, 0.8, 1.2) > 0.0, f"a way off the ramp at x = {x:.1f}"


def test_pit_and_post_are_occupied_and_a_ramp_of_10_deg_is_free(grid):
    assert share(grid, OCCUPIED, 0.8, 3.8, 4.1, 5.8) > 0.99
    assert share(grid, OCCUPIED, 2.0, 2.1, 2.0, 2.1) == 1.0
    assert share(grid, FREE, 0.6, 3.5, -1.2, 0.7) > 0.99


def test_no_ground_is_an_error():
    with pytest.raises(ValueError, match="finite"):
        bins_of([np.array([[0.0, np.nan, 0.0]])], 0.1)


def test_a_voxel_that_is_looked_through_held_a_mover():
    """A person stands at x = 3 for 2 sweeps, then 10 sweeps see the wall at x = 6 behind. The wall stays."""
    votes = Votes(np.zeros(3), np.array([8.0, 4.0, 3.0]), PARAMS.moving_objects)
    origin, random = np.array([1.0, 2.0, 1.0]), np.random.default_rng(0)

    def board(x: float) -> np.ndarray:
        spots = random.uniform([1.7, 0.7], [2.3, 1.3], (400, 2))
        return np.concatenate([np.full((400, 1), x), spots], axis=1)

    for _ in range(2):
        votes.add(origin, board(3.05))
    for _ in range(10):
        wall = board(6.05)
        wall[:, 1:] = (wall[:, 1:] - [2.0, 1.0]) * 3.0 + [2.0, 1.0]
        votes.add(origin, wall)
    assert votes.moved(board(3.05)).mean() > 0.95
    assert not votes.moved(board(6.05)).any()
    assert not votes.moved(np.array([[100.0, 0.0, 0.0]])).any()
