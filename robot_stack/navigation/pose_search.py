"""A* over poses (x, y, heading) in a window of the grid: for a narrow place that must be entered straight.

The route planner searches positions first and headings after, which fails where a long footprint fits only if it
enters straight. Here both are searched together, in steps of a cell and a heading, including turns on the spot.
"""

from __future__ import annotations

import heapq
import math

import numpy as np
import numpy.typing as npt

from robot_stack.core.compiled import compiled

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_LOOK = 4096
_ROWS, _COLUMNS = (0, 0, 1, -1, 1, 1, -1, -1), (1, -1, 0, 0, 1, -1, 1, -1)


@compiled(nogil=True)
def search_poses(
    free: npt.NDArray[np.bool_],
    cost: Floats,
    start: tuple[int, int, int],
    goal: tuple[int, int, int],
    cell_m: float,
    turn_cost_m_per_rad: float,
    weight: float,
    stop: npt.NDArray[np.bool_],
) -> Ints:
    """(n, 3) row, column, heading from start to goal, empty if there is no way, or if ``stop``, (1,), was set.

    free: (rows, columns, headings), heading k is k * 2 pi / headings. cost: (rows, columns) per metre, >= 1. goal: a
    heading of -1 is any. Driving sideways or backwards costs up to three times as much. weight: of the straight
    distance, >= 1.
    """
    rows, columns, bins = free.shape
    unit = 2.0 * math.pi / bins
    g = np.full(rows * columns * bins, np.inf)
    parent = np.full(rows * columns * bins, -1, np.int64)
    first = (start[0] * columns + start[1]) * bins + start[2]
    g[first] = 0.0
    heap = [(0.0, first)]
    last, taken = -1, 0
    while len(heap) > 0:
        taken += 1
        if taken % _LOOK == 0 and stop[0]:
            break
        key, here = heapq.heappop(heap)
        k = here % bins
        cell = here // bins
        row, column = cell // columns, cell % columns
        if key > g[here] + weight * cell_m * math.hypot(row - goal[0], column - goal[1]) + 1e-9:
            continue  # outdated: a better way was found
        if row == goal[0] and column == goal[1] and (goal[2] < 0 or k == goal[2]):
            last = here
            break
        for move in range(10):
            r, c, h = row, column, k
            if move < 8:
                r, c = row + _ROWS[move], column + _COLUMNS[move]
                if r < 0 or c < 0 or r >= rows or c >= columns:
                    continue
                sideways = 1.0 - math.cos(k * unit - math.atan2(_ROWS[move], _COLUMNS[move]))
                step = cell_m * math.hypot(_ROWS[move], _COLUMNS[move]) * (cost[r, c] + sideways)
            else:
                h = (k + (1 if move == 8 else bins - 1)) % bins
                step = turn_cost_m_per_rad * unit
            if not free[r, c, h]:
                continue
            there = (r * columns + c) * bins + h
            total = g[here] + step
            if total < g[there] - 1e-9:
                g[there] = total
                parent[there] = here
                left = weight * cell_m * math.hypot(r - goal[0], c - goal[1])
                heapq.heappush(heap, (total + left, there))
    if last < 0:
        return np.empty((0, 3), np.int64)
    count, at = 1, last
    while at != first:
        at = parent[at]
        count += 1
    out = np.empty((count, 3), np.int64)
    at = last
    for i in range(count - 1, -1, -1):
        out[i, 0], out[i, 1], out[i, 2] = at // bins // columns, at // bins % columns, at % bins
        at = parent[at]
    return out
