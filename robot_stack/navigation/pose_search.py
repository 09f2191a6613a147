"""A* over poses (x, y, heading) in a window of the grid: for a narrow place that must be entered straight.

The route planner searches positions first and headings after, which fails where a long footprint fits only if it
enters straight. Here both are searched together, in steps of a cell and a heading, including turns on the spot. The
heuristic is the cost of the way over the cells alone, with the best heading in each.
"""

from __future__ import annotations

import heapq
import math

import numpy as np
import numpy.typing as npt

from robot_stack.core.compiled import compiled
from robot_stack.navigation.grid_kernels import CLOSED, TIGHT, Rooms
from robot_stack.navigation.one_way import Courses, course_of, permits

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_LOOK = 4096
# Poses that are expanded before a search is given up: about a second.
_MOST = 2_000_000
_ROWS, _COLUMNS = (0, 0, 1, -1, 1, 1, -1, -1), (1, -1, 0, 0, 1, -1, 1, -1)


@compiled(nogil=True)
def _costs_to_go(room: Rooms, cost: Floats, goal: tuple[int, int, int], cell_m: float, tight_cost: float) -> Floats:
    """(rows, columns) least cost from each cell to the goal's, whatever the heading; infinite without a way."""
    rows, columns, bins = room.shape
    enter = np.full((rows, columns), np.inf)
    for r in range(rows):
        for c in range(columns):
            best = CLOSED
            for k in range(bins):
                best = max(best, room[r, c, k])
            if best != CLOSED:
                enter[r, c] = cell_m * cost[r, c] * (1.0 + tight_cost if best == TIGHT else 1.0)
    left = np.full((rows, columns), np.inf)
    left[goal[0], goal[1]] = 0.0
    heap = [(0.0, goal[0] * columns + goal[1])]
    while len(heap) > 0:
        so_far, here = heapq.heappop(heap)
        row, column = here // columns, here % columns
        if so_far > left[row, column]:
            continue
        for move in range(8):
            r, c = row + _ROWS[move], column + _COLUMNS[move]
            if r < 0 or c < 0 or r >= rows or c >= columns or enter[r, c] == np.inf:
                continue
            total = so_far + enter[row, column] * math.hypot(_ROWS[move], _COLUMNS[move])
            if total < left[r, c] - 1e-9:
                left[r, c] = total
                heapq.heappush(heap, (total, r * columns + c))
    return left


@compiled(nogil=True)
def search_poses(
    room: Rooms,
    cost: Floats,
    start: tuple[int, int, int],
    goal: tuple[int, int, int],
    cell_m: float,
    turn_cost_m_per_rad: float,
    tight_cost: float,
    weight: float,
    courses: Courses,
    escape_cells: int,
    stop: npt.NDArray[np.bool_],
) -> Ints:
    """(n, 3) row, column, heading from start to goal, empty if there is no way, or if ``stop``, (1,), was set.

    room: (rows, columns, headings) of ``heading_room``, heading k is k * 2 pi / headings. cost: (rows, columns) per
    metre, >= 1. goal: a heading of -1 is any. Driving sideways or backwards costs up to three times as much, a step to
    a tight pose 1 + tight_cost times. weight: of the heuristic, >= 1. courses: permitted in each cell, beyond a
    circle of escape_cells around the start.
    """
    rows, columns, bins = room.shape
    unit = 2.0 * math.pi / bins
    g = np.full(rows * columns * bins, np.inf)
    parent = np.full(rows * columns * bins, -1, np.int64)
    first = (start[0] * columns + start[1]) * bins + start[2]
    left = _costs_to_go(room, cost, goal, cell_m, tight_cost)
    if left[start[0], start[1]] == np.inf:
        return np.empty((0, 3), np.int64)
    g[first] = 0.0
    heap = [(0.0, first)]
    last, taken = -1, 0
    while len(heap) > 0 and taken < _MOST:
        taken += 1
        if taken % _LOOK == 0 and stop[0]:
            break
        key, here = heapq.heappop(heap)
        k = here % bins
        cell = here // bins
        row, column = cell // columns, cell % columns
        if key > g[here] + weight * left[row, column] + 1e-9:
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
                if math.hypot(r - start[0], c - start[1]) > escape_cells:
                    course = course_of(_COLUMNS[move], _ROWS[move])
                    if not (permits(courses, row, column, course) and permits(courses, r, c, course)):
                        continue
                sideways = 1.0 - math.cos(k * unit - math.atan2(_ROWS[move], _COLUMNS[move]))
                step = cell_m * math.hypot(_ROWS[move], _COLUMNS[move]) * (cost[r, c] + sideways)
            else:
                h = (k + (1 if move == 8 else bins - 1)) % bins
                step = turn_cost_m_per_rad * unit
            if room[r, c, h] == CLOSED:
                continue
            if room[r, c, h] == TIGHT:
                step *= 1.0 + tight_cost
            there = (r * columns + c) * bins + h
            total = g[here] + step
            if total < g[there] - 1e-9:
                g[there] = total
                parent[there] = here
                heapq.heappush(heap, (total + weight * left[r, c], there))
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
