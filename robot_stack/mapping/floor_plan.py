"""A site's map from a floor plan: the dark parts of a picture extruded into vertical walls on a level floor."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_edt, label

from robot_stack.core.geometry import Pose2
from robot_stack.core.site_map import FREE, OCCUPIED, UNKNOWN, Cells, Grid
from robot_stack.mapping.cells import CellAccumulator
from robot_stack.mapping.params import MappingParams
from robot_stack.mapping.poses import Floats

Mask = npt.NDArray[np.bool_]
# From a pixel of the floor to the pixels beside it: rows, columns.
_SIDES = ((0, 1), (0, -1), (1, 0), (-1, 0))
_HEIGHT_STEP_M = 0.1
_GAP_M = 0.5  # narrower gaps between walls are not passages, but inaccuracies of the drawing
# The floor lies just below z = 0, so that it never shares a voxel with the foot of a wall.
_FLOOR_Z_M = -0.005
_FLOOR_STEP_M = 0.1
# Samples of a pixel along its edge, by which its share of the grid's cells is measured.
_FEWEST_PARTS = 2
_EXACT = 1e-6  # of a cell: a border of the picture on a border of the grid
# Of the built walls around the drawn ones. A match that furniture misled on the coarse levels does not come back to
# thinner surfaces.
_ROUGHNESS_M = 0.05
_OCCUPIED_SHARE = 0.25  # of a cell of the grid: a wall of one pixel between two cells stays closed


class PlanError(Exception):
    """The plan makes no map. The text gives the reason and the remedy."""


@dataclass(frozen=True, slots=True)
class Plan:
    """walls, floor: (rows, columns), row 0 at the lowest y of the picture; a pixel may be neither.

    resolution_m: edge of a pixel. origin: the lower left corner of the picture in map.
    """

    walls: Mask
    floor: Mask
    resolution_m: float
    origin: Pose2

    def to_map(self, row: npt.ArrayLike, column: npt.ArrayLike) -> Floats:
        """(n, 2) m of places in the picture, in pixels from its lower left corner."""
        x, y = (self.resolution_m * np.asarray(part, np.float64) for part in (column, row))
        c, s = math.cos(self.origin.yaw), math.sin(self.origin.yaw)
        return np.stack([self.origin.x + c * x - s * y, self.origin.y + s * x + c * y], axis=1)

    def pixel_of(self, x_m: float, y_m: float) -> tuple[int, int]:
        """(row, column) of a place in map; may be outside of the picture."""
        at = Pose2(x_m, y_m, 0.0).relative_to(self.origin)
        return math.floor(at.y / self.resolution_m), math.floor(at.x / self.resolution_m)


def map_of_plan(plan: Plan, starts: Sequence[Pose2], wall_height_m: float, params: MappingParams) -> tuple[Cells, Grid]:
    """starts: places on the floor; floor that is connected with none of them is unknown. Raises PlanError."""
    for name, share in (
        ("dark: there are no walls", plan.walls.mean()),
        ("white: there is no floor", plan.floor.mean()),
    ):
        if share == 0.0:
            raise PlanError(f"no pixel is {name}")
    reached: Mask = np.any([_reached(plan, start) for start in starts], axis=0)
    every = max(1, round(_FLOOR_STEP_M / plan.resolution_m))
    row, column = np.nonzero(reached[::every, ::every])
    floor = plan.to_map(every * row + 0.5, every * column + 0.5)
    faces = _faces(plan, reached)
    if not len(faces):
        raise PlanError("no wall adjoins the floor around the start")
    heights = np.arange(0.5 * _HEIGHT_STEP_M, wall_height_m, _HEIGHT_STEP_M)
    cells = CellAccumulator(params.cells.size_m)
    cells.add(_at_heights(floor, np.array([_FLOOR_Z_M])))
    cells.add(_at_heights(faces, np.array([_FLOOR_Z_M, *heights])))
    made = cells.cells(params.cells.fewest_points)
    rough = replace(made, covariance=made.covariance + _ROUGHNESS_M**2 * np.eye(3))
    return rough, _grid(plan, reached, params.grid.resolution_m)


def _reached(plan: Plan, start: Pose2) -> Mask:
    row, column = plan.pixel_of(start.x, start.y)
    rows, columns = plan.floor.shape
    if not (0 <= row < rows and 0 <= column < columns and plan.floor[row, column]):
        corners = plan.to_map([0, 0, rows, rows], [0, columns, 0, columns])
        (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
        raise PlanError(
            f"the start ({start.x:g}, {start.y:g}) is not on the floor of the picture, which covers x {x0:.1f} to "
            f"{x1:.1f} m and y {y0:.1f} to {y1:.1f} m: give --start, or another --origin"
        )
    half = 0.5 * _GAP_M / plan.resolution_m
    regions, _ = label(distance_transform_edt(np.pad(plan.floor, 1))[1:-1, 1:-1] > half)
    if not regions[row, column]:
        raise PlanError(f"the start ({start.x:g}, {start.y:g}) is within {0.5 * _GAP_M:g} m of a wall: give --start")
    reached: Mask = plan.floor & (distance_transform_edt(regions != regions[row, column]) <= half + 1.0)
    return reached


def _faces(plan: Plan, reached: Mask) -> Floats:
    """(n, 2) m: middles of the edges between a pixel of the reached floor and one of a wall."""
    rows, columns = reached.shape
    walls = np.pad(plan.walls, 1)
    found = []
    for down, right in _SIDES:
        beside = walls[1 + down : 1 + down + rows, 1 + right : 1 + right + columns]
        row, column = np.nonzero(reached & beside)
        found.append(plan.to_map(row + 0.5 + 0.5 * down, column + 0.5 + 0.5 * right))
    return np.concatenate(found)


def _grid(plan: Plan, reached: Mask, resolution_m: float) -> Grid:
    """The reached floor and all walls of the plan; a wall counts in every cell of which it covers a fair share."""
    seen = np.argwhere(plan.walls | reached)
    low, high = seen.min(axis=0), seen.max(axis=0) + 1
    corners = plan.to_map([low[0], low[0], high[0], high[0]], [low[1], high[1], low[1], high[1]])
    first = np.floor(corners.min(axis=0) / resolution_m + _EXACT).astype(np.int64)
    shape = np.ceil(corners.max(axis=0) / resolution_m - _EXACT).astype(np.int64) - first
    parts = max(_FEWEST_PARTS, math.ceil(2.0 * plan.resolution_m / resolution_m))
    offsets = (np.arange(parts) + 0.5) / parts
    walls, floor = np.zeros(tuple(shape), np.int32), np.zeros(tuple(shape), np.int32)
    for mask, count in ((plan.walls, walls), (reached, floor)):
        row, column = np.nonzero(mask)
        for down, right in itertools.product(offsets, offsets):
            index = np.floor(plan.to_map(row + down, column + right) / resolution_m).astype(np.int64) - first
            np.add.at(count, tuple(index.T), 1)
    occupancy = np.full(tuple(shape), UNKNOWN, np.int8)
    occupancy[floor > 0] = FREE
    occupancy[walls * (plan.resolution_m / parts / resolution_m) ** 2 >= _OCCUPIED_SHARE] = OCCUPIED
    x, y = (first * resolution_m).tolist()
    return Grid(resolution_m, x, y, np.ascontiguousarray(occupancy.T))


def _at_heights(places: Floats, heights: Floats) -> Floats:
    """(n * k, 3) m: each of the (n, 2) places at each of the (k,) heights."""
    return np.column_stack([np.repeat(places, len(heights), axis=0), np.tile(heights, len(places))])
