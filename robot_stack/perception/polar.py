"""Polar grid around the sensor: points sorted by direction and distance, and the statistics of each cell.

A spinning sensor sees ground in rings: radial cells, short near it and long far away, hold about one ring each, and
the cells of one direction in order of distance are a profile of the ground.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.perception.params import GroundParams

Float = NDArray[np.float32]
Int = NDArray[np.int32]

TABLE_STEP_M = 0.05
# The values of a cell, adjacent in memory: they are written and evaluated together.
# LOWEST, SECOND, TOP: heights of the two lowest points and the highest. COUNT: points of the lowest band, whose means
# HEIGHT and DISTANCE are. GROUND_M: height of the ground there. RISE: how far it stands above the ground before it.
LOWEST, SECOND, TOP, COUNT, HEIGHT, DISTANCE, GROUND_M, RISE = range(8)
_COLUMNS = 8
_BLOCK = 256  # points per block: their coordinates stay in the fastest cache
_NONE = np.float32(np.inf)
PI = np.float32(math.pi)
HALF_PI = np.float32(0.5 * math.pi)


@dataclass(frozen=True, slots=True)
class PolarGrid:
    """sectors: number of directions. edges_m: (k + 1,) radii between cells. table: cell by radius / 0.05 m."""

    sectors: int
    edges_m: Float
    table: Int

    @property
    def rings(self) -> int:
        return len(self.edges_m) - 1


def make_grid(params: GroundParams, reach_m: float = math.inf) -> PolarGrid:
    """reach_m: farther cells are left out, except for the rest of their kind."""
    edges = [0.0]
    for bins in params.bins:
        if edges[-1] >= reach_m:
            break
        count = max(1, round((bins.radius_m - edges[-1]) / bins.length_m))
        edges += [edges[-1] + bins.length_m * (i + 1) for i in range(count)]
    edges_m = np.array(edges, dtype=np.float32)
    radii = (np.arange(int(edges[-1] / TABLE_STEP_M)) + 0.5) * TABLE_STEP_M
    table = (np.searchsorted(edges_m, radii, side="right") - 1).astype(np.int32)
    return PolarGrid(params.sectors, edges_m, table)


@dataclass(frozen=True, slots=True)
class Cells:
    """Statistics of the cells; heights and distances in m, levelled frame.

    values: (sectors, rings, 8), columns LOWEST to RISE; an empty cell has COUNT 0. sectors: (k,) directions that hold
    points, and two on each side of them: values of all others are not set. A half sweep shows half of them.
    """

    values: Float
    sectors: Int


@dataclass(frozen=True, slots=True)
class Sorted:
    """Points in cells. cell: (n,) sector * rings + ring, -1 outside the grid; height_m, distance_m: (n,), levelled."""

    cell: Int
    height_m: Float
    distance_m: Float
    cells: Cells


def sort_points(
    xyz: Float, level: Float, origin: tuple[float, float], grid: PolarGrid, band_m: float, gap_m: float
) -> Sorted:
    """Sorts points (n, 3) base_link; level: (3, 3) base_link to levelled; origin: the sensor there, x and y.

    A cell's height is the mean of its points within ``band_m`` of the lowest; a single lowest point more than ``gap_m``
    below the next one is left out.
    """
    n = len(xyz)
    cell, height, distance = np.empty(n, np.int32), np.empty(n, np.float32), np.empty(n, np.float32)
    values = np.empty((grid.sectors, grid.rings, _COLUMNS), np.float32)
    touched = np.zeros(grid.sectors, np.bool_)
    upright, x0, y0 = np.ascontiguousarray(level, dtype=np.float32), np.float32(origin[0]), np.float32(origin[1])
    _place(xyz, upright, x0, y0, grid.table, values, touched, cell, height, distance)
    sectors = np.flatnonzero(np.any([np.roll(touched, step) for step in range(-2, 3)], axis=0)).astype(np.int32)
    _average(cell, height, distance, np.float32(band_m), np.float32(gap_m), sectors, touched, values)
    return Sorted(cell, height, distance, Cells(values, sectors))


@compiled(error_model="numpy", inline="always")
def angle_of(y: Any, x: Any) -> Any:
    """atan2 to 1e-4 rad, three times as fast and without branches, so that loops over it become vector code."""
    ax, ay = abs(x), abs(y)
    great, small = max(ax, ay), min(ax, ay)
    a = small / max(great, np.float32(1e-30))
    s = a * a
    angle = ((np.float32(-0.0464964749) * s + np.float32(0.15931422)) * s - np.float32(0.327622764)) * s * a + a
    angle = HALF_PI - angle if ay > ax else angle
    angle = PI - angle if x < np.float32(0.0) else angle
    return -angle if y < np.float32(0.0) else angle


@compiled(error_model="numpy")
def _empty_direction(rings: int) -> Float:
    """(rings * 8,) values of the cells of a direction without points."""
    empty = np.zeros((rings, _COLUMNS), np.float32)
    empty[:, LOWEST] = empty[:, SECOND] = _NONE
    empty[:, TOP] = -_NONE
    return empty.ravel()


@compiled(error_model="numpy")
def _clear(flat: Float, sector: int, empty: Float) -> None:
    """Makes the cells of a direction empty. flat: all cells in a row."""
    first = sector * len(empty)
    direction = flat[first : first + len(empty)]
    for i in range(len(empty)):
        direction[i] = empty[i]


@compiled(error_model="numpy")
def _place(
    xyz: Float,
    level: Float,
    x0: Any,
    y0: Any,
    table: Int,
    values: Float,
    touched: Any,
    cell: Int,
    height: Float,
    distance: Float,
) -> None:
    """Direction, distance, height and cell of every point, and the lowest and highest of each cell."""
    sectors, rings = values.shape[0], values.shape[1]
    cells = values.reshape((sectors * rings, _COLUMNS))
    flat, empty = values.ravel(), _empty_direction(rings)
    per_rad, per_m = np.float32(sectors / (2.0 * math.pi)), np.float32(1.0 / TABLE_STEP_M)
    a0, a1, a2 = level[0, 0], level[0, 1], level[0, 2]
    b0, b1, b2 = level[1, 0], level[1, 1], level[1, 2]
    c0, c1, c2 = level[2, 0], level[2, 1], level[2, 2]
    outside = np.float32(len(table))
    # x, y and z in one array, and sector and slot too: with more arrays the compiler could not exclude that they
    # overlap, and would not vectorise.
    place, found = np.empty(3 * _BLOCK, np.float32), np.empty(2 * _BLOCK, np.int32)
    for begin in range(0, len(xyz), _BLOCK):
        size = min(_BLOCK, len(xyz) - begin)
        for i in range(size):
            place[i], place[_BLOCK + i], place[2 * _BLOCK + i] = xyz[begin + i, 0], xyz[begin + i, 1], xyz[begin + i, 2]
        high, away = height[begin : begin + size], distance[begin : begin + size]
        for i in range(size):  # arithmetic alone
            px, py, pz = place[i], place[_BLOCK + i], place[2 * _BLOCK + i]
            x = a0 * px + a1 * py + a2 * pz - x0
            y = b0 * px + b1 * py + b2 * pz - y0
            high[i] = c0 * px + c1 * py + c2 * pz
            d = np.float32(math.sqrt(x * x + y * y))
            away[i] = d
            found[i] = np.int32((angle_of(y, x) + PI) * per_rad)
            d *= per_m
            found[_BLOCK + i] = np.int32(d if d < outside else outside)
        for i in range(size):
            slot = found[_BLOCK + i]
            if slot >= len(table):
                cell[begin + i] = -1
                continue
            s = min(found[i], np.int32(sectors - 1))
            if not touched[s]:
                touched[s] = True
                _clear(flat, s, empty)
            number = s * np.int32(rings) + table[slot]
            cell[begin + i] = number
            c = np.uint32(number)  # unsigned: no wrap-around to look after
            z = high[i]
            # Without branches: they are unpredictable, and a misprediction costs more than three writes.
            first, second, top = cells[c, LOWEST], cells[c, SECOND], cells[c, TOP]
            higher = first if z < first else z
            cells[c, LOWEST] = z if z < first else first
            cells[c, SECOND] = higher if higher < second else second
            cells[c, TOP] = z if z > top else top


@compiled(error_model="numpy")
def _average(
    cell: Int, height: Float, distance: Float, band: Any, gap: Any, active: Int, touched: Any, values: Float
) -> None:
    sectors, rings = values.shape[0], values.shape[1]
    cells = values.reshape((sectors * rings, _COLUMNS))
    flat, empty = values.ravel(), _empty_direction(rings)
    for i in range(len(cell)):
        if cell[i] < 0:
            continue
        c = np.uint32(cell[i])
        first, second = cells[c, LOWEST], cells[c, SECOND]
        above = height[i] - (second if second < _NONE and second - first > gap else first)
        if np.float32(0.0) <= above <= band:
            cells[c, COUNT] += np.float32(1.0)
            cells[c, HEIGHT] += height[i]
            cells[c, DISTANCE] += distance[i]
    for s in active:
        if not touched[s]:
            _clear(flat, s, empty)
            continue
        for k in range(rings):
            if values[s, k, COUNT] > np.float32(0.0):
                share = np.float32(1.0) / values[s, k, COUNT]
                values[s, k, HEIGHT] *= share
                values[s, k, DISTANCE] *= share
