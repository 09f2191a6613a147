"""Maps from floor plans: where walls and floor are in cells and grid, and plans that make no map."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.core.config import load
from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.core.site_map import FREE, OCCUPIED, UNKNOWN, Cells, Grid
from robot_stack.mapping.floor_plan import Plan, PlanError, map_of_plan
from robot_stack.mapping.params import MappingParams

PARAMS = load(MappingParams, "mapping")
PIXEL_M = 0.05
HEIGHT_M = 2.5
INSIDE = Pose2(3.0, 2.0, 0.0)


def room(origin: Pose2 = IDENTITY, gap_m: float = 0.0) -> Plan:
    """A room of 6 x 4 m within walls of 0.2 m, in a picture with a margin of 1 m; a gap in the wall at x = 6.

    The picture's corner is at (-1.2, -1.2) in the room.
    """
    walls = np.zeros((round(6.4 / PIXEL_M), round(8.4 / PIXEL_M)), np.bool_)
    walls[20:-20, 20:-20] = True
    walls[24:-24, 24:-24] = False
    walls[40 : 40 + round(gap_m / PIXEL_M), -24:-20] = False
    return Plan(walls, ~walls, PIXEL_M, origin.compose(Pose2(-1.2, -1.2, 0.0)))


def value(grid: Grid, x_m: float, y_m: float) -> int:
    row = math.floor((y_m - grid.origin_y_m) / grid.resolution_m)
    column = math.floor((x_m - grid.origin_x_m) / grid.resolution_m)
    inside = 0 <= row < grid.occupancy.shape[0] and 0 <= column < grid.occupancy.shape[1]
    return int(grid.occupancy[row, column]) if inside else UNKNOWN


def near(cells: Cells, x_m: float, y_m: float, z_m: float) -> int:
    """The row of the cell whose mean is nearest."""
    return int(np.linalg.norm(cells.mean - (x_m, y_m, z_m), axis=1).argmin())


def test_a_wall_is_its_surface_towards_the_floor() -> None:
    cells, _ = map_of_plan(room(), [INSIDE], HEIGHT_M, PARAMS)
    wall = near(cells, 2.5, 0.0, 1.5)
    assert cells.mean[wall] == pytest.approx((2.5, 0.0, 1.5), abs=1e-6)
    extent, rough = 1 / 12, 0.05**2
    assert np.diag(cells.covariance[wall]) == pytest.approx((extent + rough, rough, extent + rough), abs=1e-3)
    assert cells.mean[:, 2].max() < HEIGHT_M
    floor = near(cells, 2.5, 1.5, 0.0)
    assert cells.mean[floor] == pytest.approx((2.5, 1.5, 0.0), abs=0.06)
    assert cells.covariance[floor][2, 2] == pytest.approx(rough)
    # No cell lies behind a surface: the rear of the walls and the floor outside cannot be seen.
    assert cells.mean[:, :2].min() > -1e-6
    assert (cells.mean[:, 0].max(), cells.mean[:, 1].max()) == pytest.approx((6.0, 4.0), abs=1e-6)


def test_the_grid_has_the_walls_and_the_floor_of_the_room() -> None:
    _, grid = map_of_plan(room(), [INSIDE], HEIGHT_M, PARAMS)
    assert grid.resolution_m == PARAMS.grid.resolution_m
    assert value(grid, 0.05, 0.05) == value(grid, 5.95, 3.95) == FREE
    assert value(grid, -0.05, 2.0) == value(grid, 6.05, 2.0) == value(grid, 3.0, 4.15) == OCCUPIED
    assert value(grid, -0.5, 2.0) == UNKNOWN
    assert (grid.occupancy == FREE).sum() * 0.01 == pytest.approx(24.0)


def test_a_turned_plan_makes_the_same_map_turned() -> None:
    origin = Pose2(10.0, -5.0, 0.6)
    start = origin.compose(INSIDE)
    cells, grid = map_of_plan(room(origin), [start], HEIGHT_M, PARAMS)
    for x_m, y_m, expected in ((3.0, 2.0, FREE), (-0.1, 2.0, OCCUPIED), (3.0, 4.1, OCCUPIED), (-0.5, 2.0, UNKNOWN)):
        there = origin.compose(Pose2(x_m, y_m, 0.0))
        assert value(grid, there.x, there.y) == expected
    upper = cells.mean[cells.mean[:, 2] > 1.0]
    local = np.array([Pose2(x, y, 0.0).relative_to(origin) for x, y, _ in upper], dtype=object)
    off = [min(abs(at.x), abs(at.x - 6.0), abs(at.y), abs(at.y - 4.0)) for at in local]
    assert np.median(off) < 0.02


@pytest.mark.parametrize(("gap_m", "outside"), [(0.4, UNKNOWN), (0.8, FREE)])
def test_floor_behind_a_passage_is_reached_and_behind_a_drawn_gap_it_is_not(gap_m: float, outside: int) -> None:
    _, grid = map_of_plan(room(gap_m=gap_m), [INSIDE], HEIGHT_M, PARAMS)
    assert value(grid, 6.7, 3.0) == outside


def test_a_wall_of_one_pixel_between_two_cells_is_closed_in_the_grid() -> None:
    walls = np.zeros((80, 80), np.bool_)
    walls[:, 41] = walls[[0, -1], :] = walls[:, [0, -1]] = True
    plan = Plan(walls, ~walls, PIXEL_M, Pose2(0.025, 0.0, 0.0))
    _, grid = map_of_plan(plan, [Pose2(1.0, 2.0, 0.0)], HEIGHT_M, PARAMS)
    assert (grid.occupancy[:, 20:22] == OCCUPIED).any(axis=1).all()


@pytest.mark.parametrize(
    ("plan", "start", "words"),
    [
        (Plan(np.zeros((60, 60), np.bool_), np.ones((60, 60), np.bool_), PIXEL_M, IDENTITY), INSIDE, "no walls"),
        (Plan(np.ones((60, 60), np.bool_), np.zeros((60, 60), np.bool_), PIXEL_M, IDENTITY), INSIDE, "no floor"),
        (room(), Pose2(-0.1, 2.0, 0.0), "not on the floor of the picture, which covers x -1.2 to 7.2 m"),
        (room(), Pose2(30.0, 2.0, 0.0), "not on the floor"),
        (room(), Pose2(0.1, 2.0, 0.0), "within 0.25 m of a wall"),
    ],
)
def test_plans_that_make_no_map(plan: Plan, start: Pose2, words: str) -> None:
    with pytest.raises(PlanError, match=words):
        map_of_plan(plan, [start], HEIGHT_M, PARAMS)
