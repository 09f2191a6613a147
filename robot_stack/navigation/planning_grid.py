"""The grid of the global planner: the site map with an overlay of obstacles seen by the costmap."""

from __future__ import annotations

import copy
import math
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from robot_stack.core.distance_field import clearance_field
from robot_stack.core.geometry import Pose2
from robot_stack.core.site_map import OCCUPIED, UNKNOWN, Grid
from robot_stack.navigation.grid_kernels import Singles, clearances
from robot_stack.navigation.one_way import FREE_COURSES, Courses

Array = npt.NDArray[np.float64]
Value = TypeVar("Value", bound=np.generic)
# Largest clearance computed; also the radius in which a seen obstacle changes it.
FAR_M = 3.0
_MOST_CELLS = 4_000_000


class PlanningGrid:
    """Clearances of a grid in map. field: (rows, columns) metres; unknown: (rows, columns).

    bounded: nothing is passable outside the grid; False for the substitute grid of a site without a map.
    courses: that the site's one-way zones permit in each cell.
    """

    def __init__(self, grid: Grid, *, bounded: bool = True, courses: Courses = FREE_COURSES) -> None:
        self.resolution_m = grid.resolution_m
        self.x_m, self.y_m = grid.origin_x_m, grid.origin_y_m
        self.bounded, self.courses = bounded, courses
        self.unknown = np.ascontiguousarray(grid.occupancy == UNKNOWN)
        obstacles = np.pad(grid.occupancy == OCCUPIED, 1, constant_values=bounded)
        field = clearance_field(obstacles, grid.resolution_m, FAR_M)[1:-1, 1:-1]
        self.known_field: Singles = np.ascontiguousarray(field)
        self.field = self.known_field
        self._changed: tuple[slice, slice] | None = None

    def view(self) -> PlanningGrid:
        """A view with the same read-only known obstacles and an overlay of its own, for another thread."""
        other = copy.copy(self)
        other.field, other._changed = self.known_field, None
        return other

    @property
    def half_cell_m(self) -> float:
        """Half a cell, m: clearances are to cell centres, and obstacles extend to the cell's edge."""
        return 0.5 * self.resolution_m

    def contains(self, x: float, y: float) -> bool:
        row, column = self.cell(x, y)
        rows, columns = self.field.shape
        return bool(0 <= row < rows and 0 <= column < columns)

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """(row, column) of a point in map."""
        return math.floor((y - self.y_m) / self.resolution_m), math.floor((x - self.x_m) / self.resolution_m)

    def values(self, cells: npt.NDArray[Value], points: Array, outside: Value | float) -> npt.NDArray[Value]:
        """(n,) values of ``cells``, (rows, columns) as of this grid, at (n, 2) points in map; ``outside`` off it."""
        column, row = np.floor((points - (self.x_m, self.y_m)) / self.resolution_m).astype(np.int64).T
        inside = (row >= 0) & (column >= 0) & (row < cells.shape[0]) & (column < cells.shape[1])
        found = np.full(len(points), outside, cells.dtype)
        found[inside] = cells[row[inside], column[inside]]
        return found

    def lay_over(self, points: Array) -> None:
        """Marks (n, 2) obstacle points in map as occupied and clears those of the last call."""
        if self._changed is not None:
            self.field[self._changed] = self.known_field[self._changed]
            self._changed = None
        cells = np.floor((points - (self.x_m, self.y_m)) / self.resolution_m).astype(np.int64)[:, ::-1]
        shape = np.array(self.field.shape)
        cells = cells[np.all((cells >= 0) & (cells < shape), axis=1)]
        if not len(cells):
            return
        if self.field is self.known_field:
            self.field = self.known_field.copy()
        pad = math.ceil(FAR_M / self.resolution_m)
        low = np.maximum(cells.min(axis=0) - pad, 0)
        high = np.minimum(cells.max(axis=0) + pad + 1, shape)
        occupied = np.zeros(tuple(high - low), np.bool_)
        occupied[tuple((cells - low).T)] = True
        window = slice(low[0], high[0]), slice(low[1], high[1])
        seen = clearance_field(occupied, self.resolution_m, FAR_M)
        self.field[window] = np.minimum(self.known_field[window], seen)
        self._changed = window

    def clearance_m(self, outline: Array, poses: Array, *, known: bool = False) -> Array:
        """(n,) clearance of the outline at (n, 3) poses in map. known: by the map alone."""
        field = self.known_field if known else self.field
        outside_m = 0.0 if self.bounded else FAR_M
        return clearances(field, self.resolution_m, self.x_m, self.y_m, outline, poses, outside_m)


def empty_grid(start: Pose2, goal: Pose2, pad_m: float, resolution_m: float) -> Grid:
    """A grid without obstacles around two points, for a site without a map; coarser if they are far apart."""
    low_x, low_y = min(start.x, goal.x) - pad_m, min(start.y, goal.y) - pad_m
    width, height = max(start.x, goal.x) + pad_m - low_x, max(start.y, goal.y) + pad_m - low_y
    resolution_m = max(resolution_m, math.sqrt(width * height / _MOST_CELLS))
    shape = math.ceil(height / resolution_m), math.ceil(width / resolution_m)
    return Grid(resolution_m, low_x, low_y, np.zeros(shape, np.int8))
