"""Compiled loops of the costmap. They live in one file: numba's cache looks at one file only.

Grids are (rows, columns), row 0 at the lowest y. Cells are named by the integers floor(x / resolution) and
floor(y / resolution) in odom; ``corner`` (2,) is that of row 0, column 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])
Cells = NDArray[np.int8]
Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

UNKNOWN, FREE, OCCUPIED = np.int8(-1), np.int8(0), np.int8(100)
_FAR = 1e12


def compiled(function: FunctionT) -> FunctionT:
    return cast(FunctionT, numba.njit(cache=True, fastmath=False)(function))


@compiled
def mark(
    state: Cells,
    since_s: Floats,
    seen_s: Floats,
    top_m: Singles,
    nearest_m: Floats,
    points: Singles,
    pose: Floats,
    corner: NDArray[np.int64],
    resolution_m: float,
    stamp_s: float,
) -> None:
    """Marks the cells of obstacle points, and notes the nearest of them in each direction.

    state, since_s, seen_s, top_m: the grid: what is there, since when, when it was seen last, how high it is above
    base_link's ground. nearest_m: (directions,) is overwritten. points: (n, 3) base_link, m; those that are not finite
    are left out. pose: (3,) base_link in odom.
    """
    rows, columns = state.shape
    directions = len(nearest_m)
    nearest_m[:] = np.inf
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for i in range(len(points)):
        x, y, z = float(points[i, 0]), float(points[i, 1]), points[i, 2]
        if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
            continue
        range_m = math.sqrt(x * x + y * y)
        bearing = int((math.atan2(y, x) + math.pi) / (2.0 * math.pi) * directions) % directions
        nearest_m[bearing] = min(nearest_m[bearing], range_m)
        column = math.floor((pose[0] + c * x - s * y) / resolution_m) - corner[0]
        row = math.floor((pose[1] + s * x + c * y) / resolution_m) - corner[1]
        if not (0 <= row < rows and 0 <= column < columns):
            continue
        if state[row, column] != OCCUPIED:
            since_s[row, column] = stamp_s
        if state[row, column] != OCCUPIED or seen_s[row, column] != stamp_s:
            state[row, column] = OCCUPIED
            seen_s[row, column] = stamp_s
            top_m[row, column] = z
        else:
            top_m[row, column] = max(top_m[row, column], z)


@compiled
def clear(
    state: Cells,
    since_s: Floats,
    seen_s: Floats,
    top_m: Singles,
    nearest_m: Floats,
    free_m: Floats,
    pose: Floats,
    corner: NDArray[np.int64],
    resolution_m: float,
    footprint: Floats,
    lidar: Floats,
    lives: Floats,
    stamp_s: float,
) -> None:
    """Clears what is not there any more, and makes known what has been seen free.

    nearest_m: (directions,) range of the nearest obstacle, inf without one. free_m: (directions,) range to which ground
    was seen free, 0 where it was not. footprint: rear, front, half width, m: free, because the robot stands there.
    lidar: x m, z m, tangent of the lowest ray, margin m: a mark whose top is below the lowest ray cannot be seen, so
    that not to see it says nothing. lives: s that a mark lives unseen: before a ray may clear it, in view, out of view;
    and s that it must have been seen for the last of them: what was there only for a moment has walked on.
    """
    rows, columns = state.shape
    directions = len(nearest_m)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    half_cell_m = 0.5 * resolution_m
    for row in range(rows):
        dy = (row + corner[1] + 0.5) * resolution_m - pose[1]
        for column in range(columns):
            if state[row, column] == FREE:
                continue
            dx = (column + corner[0] + 0.5) * resolution_m - pose[0]
            x, y = c * dx + s * dy, c * dy - s * dx
            if footprint[0] <= x <= footprint[1] and abs(y) <= footprint[2]:
                state[row, column] = FREE
                continue
            range_m = math.sqrt(x * x + y * y)
            bearing = int((math.atan2(y, x) + math.pi) / (2.0 * math.pi) * directions) % directions
            through_m = free_m[bearing] - half_cell_m
            if state[row, column] == UNKNOWN:
                if range_m <= through_m:
                    state[row, column] = FREE
                continue
            unseen_s = stamp_s - seen_s[row, column]
            if unseen_s <= lives[0]:
                continue
            hidden = range_m > nearest_m[bearing] - half_cell_m
            lowest_m = lidar[1] + lidar[2] * math.sqrt((x - lidar[0]) ** 2 + y * y) + lidar[3]
            if hidden or top_m[row, column] <= lowest_m:
                steady = seen_s[row, column] - since_s[row, column] >= lives[3]
                gone = unseen_s > (lives[2] if steady else lives[1])
            else:
                seen_through = range_m <= through_m or nearest_m[bearing] < np.inf
                gone = seen_through or unseen_s > lives[1]
            if gone:
                state[row, column] = FREE


@compiled
def _parabolas(values: Floats, out: Floats, roots: NDArray[np.int64], bounds: Floats) -> None:
    """One line of the squared distance transform: the lower envelope of the parabolas rooted at ``values``."""
    n, k = len(values), 0
    roots[0], bounds[0], bounds[1] = 0, -_FAR, _FAR
    for q in range(1, n):
        if values[q] >= _FAR:
            continue
        meet = _meet(values, q, roots[k])
        while meet <= bounds[k]:
            k -= 1
            meet = _meet(values, q, roots[k])
        k += 1
        roots[k], bounds[k], bounds[k + 1] = q, meet, _FAR
    k = 0
    for q in range(n):
        while bounds[k + 1] < q:
            k += 1
        out[q] = (q - roots[k]) ** 2 + values[roots[k]]


@compiled
def _meet(values: Floats, q: int, root: int) -> float:
    """Where the parabolas rooted at two places cross."""
    return float((values[q] + q * q - values[root] - root * root) / (2.0 * (q - root)))


@compiled
def inflate(state: Cells, costs: Cells, out: Cells) -> None:
    """Costs around occupied cells, by the exact distance between cells' middles.

    costs: of the squared distance in cells, costs[0] that of the cell itself; beyond its end nothing costs anything. An
    unknown cell becomes a cost only where the robot's middle may not be (99); out: (rows, columns), overwritten.

    Exact distance transform: Felzenszwalb and Huttenlocher, "Distance Transforms of Sampled Functions", Theory of
    Computing 2012.
    """
    rows, columns = state.shape
    squared = np.full((rows, columns), _FAR)
    size = max(rows, columns)
    line, result = np.empty(size), np.empty(size)
    roots, bounds = np.empty(size, np.int64), np.empty(size + 1)
    for row in range(rows):
        gap = _FAR
        for column in range(columns):
            gap = 0.0 if state[row, column] == OCCUPIED else gap + 1.0
            squared[row, column] = gap
        gap = _FAR
        for column in range(columns - 1, -1, -1):
            gap = 0.0 if state[row, column] == OCCUPIED else gap + 1.0
            gap = min(gap, squared[row, column])
            squared[row, column] = gap
    most = len(costs)
    for column in range(columns):
        for row in range(rows):
            gap = squared[row, column]
            line[row] = gap * gap if gap < _FAR else _FAR
        _parabolas(line[:rows], result[:rows], roots[:rows], bounds[: rows + 1])
        for row in range(rows):
            cost = costs[int(result[row])] if result[row] < most else FREE
            if state[row, column] == UNKNOWN and cost < 99:
                cost = UNKNOWN
            out[row, column] = cost
