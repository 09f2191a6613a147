"""Compiled loops of the global planner: A*, line of sight, headings.

Grids are (rows, columns), row 0 at the lowest y; clearances are metres from a cell's middle to that of the nearest
occupied cell. The clearance outside a grid is zero.

They release the interpreter lock, so that a plan of a second blocks no other thread. Long searches poll ``stop``, a
(1,) flag that another thread sets to cancel.
"""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robot_stack.core.compiled import compiled
from robot_stack.navigation.one_way import Courses, coarse_courses, course_of, permits

Floats = npt.NDArray[np.float64]
Singles = npt.NDArray[np.float32]
Rooms = npt.NDArray[np.int8]

Place = tuple[float, float, float]
"""Size of a cell, and x and y of the grid's lower left corner, m."""

NO_GUIDE: Singles = np.zeros((0, 0), np.float32)

# Room of the footprint at a pose.
CLOSED, TIGHT, EASY = 0, 1, 2

# Steps of a search between two polls of ``stop``: some milliseconds.
_LOOK = 4096
# Cells that the flood from the goal expands per cell of the search, and the number of cells of the search without
# coming nearer to the goal that count as stalled.
_FLOOD, _STALLED = 4, 40_000
_ESCAPE_COST = 20.0


class Ground(NamedTuple):
    """Of each cell, (rows, columns): clearance in m, whether it is unknown, and which courses it permits.

    guide: additional cost per metre, negative: closed; (0, 0) without one.
    """

    field: Singles
    unknown: npt.NDArray[np.bool_]
    courses: Courses
    guide: Singles


class Prices(NamedTuple):
    """Least and preferred clearance, m; the additional costs per metre at the least one and of unknown cells."""

    radius_m: float
    prefer_m: float
    near_cost: float
    unknown_cost: float


@compiled(nogil=True)
def clearance_at(field: Singles, resolution_m: float, origin_x: float, origin_y: float, x: float, y: float) -> float:
    return _between_cells(field, (x - origin_x) / resolution_m, (y - origin_y) / resolution_m, 0.0)


@compiled(nogil=True)
def _between_cells(field: Singles, u: float, v: float, outside: float) -> float:
    """Bilinear interpolation between cell centres: a cell's own value may be off by most of its size.

    u, v: column and row of the point, in cells from the grid's corner.
    """
    rows, columns = field.shape
    if u < 0.0 or v < 0.0 or u >= columns or v >= rows:
        return outside
    u, v = min(max(u - 0.5, 0.0), columns - 1.0), min(max(v - 0.5, 0.0), rows - 1.0)
    c, r = int(u), int(v)
    right, up = min(c + 1, columns - 1), min(r + 1, rows - 1)
    a, b = u - c, v - r
    low = (1.0 - a) * float(field[r, c]) + a * float(field[r, right])
    high = (1.0 - a) * float(field[up, c]) + a * float(field[up, right])
    return (1.0 - b) * low + b * high


@compiled(nogil=True)
def footprint_clearance(
    field: Singles, resolution_m: float, ox: float, oy: float, outline: Floats, pose: Floats, outside_m: float
) -> float:
    """Clearance of an oriented outline, metres. outline: (n, 2) in base_link; outside_m: clearance off the grid."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    least = 1e9
    for i in range(len(outline)):
        x = pose[0] + cos * outline[i, 0] - sin * outline[i, 1]
        y = pose[1] + sin * outline[i, 0] + cos * outline[i, 1]
        least = min(least, _between_cells(field, (x - ox) / resolution_m, (y - oy) / resolution_m, outside_m))
    return least


@compiled(nogil=True)
def clearances(
    field: Singles, resolution_m: float, ox: float, oy: float, outline: Floats, poses: Floats, outside_m: float
) -> Floats:
    """(n,) of footprint_clearance for (n, 3) poses."""
    out = np.empty(len(poses))
    for i in range(len(poses)):
        out[i] = footprint_clearance(field, resolution_m, ox, oy, outline, poses[i], outside_m)
    return out


@compiled(nogil=True)
def _cell_cost(clear: float, unknown: bool, prices: Prices) -> float:
    """Cost per metre in a cell, >= 1; negative: closed."""
    radius, prefer, near, unknown_cost = prices
    if clear < radius:
        return -1.0
    cost = unknown_cost if unknown else 1.0
    if clear < prefer:
        share = (prefer - clear) / (prefer - radius)
        cost += near * share * share
    return cost


@compiled(nogil=True)
def _block_cost(ground: Ground, prices: Prices, factor: int, row: int, column: int) -> float:
    """Cost of a coarse cell: that of its clearest fine cell, so that coarse cells close no gap."""
    field, unknown = ground.field, ground.unknown
    clear, strange = 0.0, False
    for r in range(row * factor, min((row + 1) * factor, field.shape[0])):
        for c in range(column * factor, min((column + 1) * factor, field.shape[1])):
            clear = max(clear, float(field[r, c]))
            strange = strange or unknown[r, c]
    return _cell_cost(clear, strange, prices)


@compiled(nogil=True)
def _enter_cost(
    cost: Singles,
    ground: Ground,
    prices: Prices,
    factor: int,
    row: int,
    column: int,
    escape_m: float,
    start: tuple[int, int],
    escape_cells: int,
) -> float:
    """Cost of a coarse cell, stored in ``cost``; negative: closed.

    escape_m: as of ``astar``. The guide of the cell's middle counts.
    """
    guide = ground.guide
    entering = _block_cost(ground, prices, factor, row, column)
    if guide.shape[0] > 0 and entering >= 0.0:
        middle_row = min(row * factor + factor // 2, guide.shape[0] - 1)
        middle_column = min(column * factor + factor // 2, guide.shape[1] - 1)
        extra = float(guide[middle_row, middle_column])
        entering = entering + extra if extra >= 0.0 else -1.0
    if entering < 0.0 and max(abs(row - start[0]), abs(column - start[1])) <= escape_cells:
        escapes = _block_cost(ground, Prices(escape_m, escape_m, 0.0, 1.0), factor, row, column) >= 0.0
        entering = _ESCAPE_COST if escapes else -1.0
    cost[row * ((ground.field.shape[1] + factor - 1) // factor) + column] = entering
    return entering


@compiled(nogil=True)
def _close_discs(cost: Singles, rows: int, columns: int, blocked: npt.NDArray[np.int64]) -> None:
    for m in range(len(blocked)):
        for r in range(max(0, blocked[m, 0] - blocked[m, 2]), min(rows, blocked[m, 0] + blocked[m, 2] + 1)):
            for c in range(max(0, blocked[m, 1] - blocked[m, 2]), min(columns, blocked[m, 1] + blocked[m, 2] + 1)):
                if (r - blocked[m, 0]) ** 2 + (c - blocked[m, 1]) ** 2 <= blocked[m, 2] ** 2:
                    cost[r * columns + c] = -1.0


@compiled(nogil=True)
def _octile(row: int, column: int, goal: tuple[int, int]) -> float:
    dr, dc = abs(row - goal[0]), abs(column - goal[1])
    return max(dr, dc) + (math.sqrt(2.0) - 1.0) * min(dr, dc)


@compiled(nogil=True)
def _way_back(parent: npt.NDArray[np.int32], first: int, last: int, columns: int) -> npt.NDArray[np.int64]:
    count, at = 1, last
    while at != first:
        at = parent[at]
        count += 1
    cells = np.empty((count, 2), np.int64)
    at = last
    for k in range(count - 1, -1, -1):
        cells[k, 0], cells[k, 1] = at // columns, at % columns
        at = parent[at]
    return cells


@compiled(nogil=True)
def astar(
    ground: Ground,
    prices: Prices,
    factor: int,
    start: tuple[int, int],
    goal: tuple[int, int],
    escape_m: float,
    weight: float,
    blocked: npt.NDArray[np.int64],
    escape_cells: int,
    flood_cells: int,
    stop: npt.NDArray[np.bool_],
) -> npt.NDArray[np.int64]:
    """(n, 2) coarse cells (row, column) from start to goal, empty if there is no way, or if it was stopped.

    weight: of the octile heuristic, >= 1. blocked: (m, 3) discs of coarse cells (row, column, radius) that are closed.
    escape_cells: within this distance of the start any cell with a clearance of escape_m may be entered, at a high
    cost, to leave a tight spot.
    A step needs both cells to permit its course, except in a circle of escape_cells around the start.

    A flood from the goal runs beside a search without progress; its first flood_cells are expanded in any case. If
    it ends without meeting the search, there is no way: this is found after the smaller of the two regions
    instead of the whole site.
    """
    field = ground.field
    rows = (field.shape[0] + factor - 1) // factor
    columns = (field.shape[1] + factor - 1) // factor
    cost = np.full(rows * columns, np.float32(np.nan), np.float32)
    g = np.full(rows * columns, np.inf)  # in single precision a rounded cost could be improved for ever
    parent = np.full(rows * columns, -1, np.int32)
    ways = coarse_courses(ground.courses, factor)
    one_way = ways.shape[0] > 0
    _close_discs(cost, rows, columns, blocked)
    first, last = start[0] * columns + start[1], goal[0] * columns + goal[1]
    g[first] = 0.0
    parent[first] = first
    heap = [(0.0, first)]
    flooded = np.zeros(rows * columns, np.bool_)
    flood = np.empty(rows * columns, np.int32)
    flood_from, flood_to, floods = 0, 0, first != last
    if floods:
        if _enter_cost(cost, ground, prices, factor, goal[0], goal[1], escape_m, start, escape_cells) < 0.0:
            return np.empty((0, 2), np.int64)
        flood[0], flooded[last], flood_to = last, True, 1
    diagonal = math.sqrt(2.0)
    taken, nearest, nearest_at = 0, np.inf, 0
    while heap:
        taken += 1
        if taken % _LOOK == 0 and stop[0]:
            return np.empty((0, 2), np.int64)
        for _ in range(_FLOOD):
            if not floods or (flood_to > flood_cells and taken - nearest_at < _STALLED):
                break
            if flood_from == flood_to:
                return np.empty((0, 2), np.int64)
            from_row, from_column = flood[flood_from] // columns, flood[flood_from] % columns
            flood_from += 1
            for i in range(-1, 2):
                for j in range(-1, 2):
                    r, c = from_row + i, from_column + j
                    if r < 0 or c < 0 or r >= rows or c >= columns or flooded[r * columns + c]:
                        continue
                    flooded[r * columns + c] = True
                    if g[r * columns + c] < np.inf:
                        floods = False
                    entering = cost[r * columns + c]
                    if math.isnan(entering):
                        entering = _enter_cost(cost, ground, prices, factor, r, c, escape_m, start, escape_cells)
                    if entering >= 0.0:
                        flood[flood_to] = r * columns + c
                        flood_to += 1
        key, here = heapq.heappop(heap)
        if here == last:
            break
        row, column = here // columns, here % columns
        left = _octile(row, column, goal)
        if key > g[here] + weight * left + 1e-6:
            continue  # outdated: a better way was found
        if left < nearest:
            nearest, nearest_at = left, taken
        for i in range(-1, 2):
            for j in range(-1, 2):
                r, c = row + i, column + j
                if (i == 0 and j == 0) or r < 0 or c < 0 or r >= rows or c >= columns:
                    continue
                there = r * columns + c
                step = diagonal if i != 0 and j != 0 else 1.0
                if g[there] <= g[here] + step:
                    continue
                entering = cost[there]
                if math.isnan(entering):
                    entering = _enter_cost(cost, ground, prices, factor, r, c, escape_m, start, escape_cells)
                if entering < 0.0:
                    continue
                if one_way:
                    course = course_of(j, i)
                    if not (permits(ways, row, column, course) and permits(ways, r, c, course)):
                        if math.hypot(r - start[0], c - start[1]) > escape_cells:
                            continue
                        entering = _ESCAPE_COST
                total = g[here] + step * entering
                if total < g[there] - 1e-6:
                    g[there] = total
                    parent[there] = here
                    heapq.heappush(heap, (total + weight * _octile(r, c, goal), there))
    if parent[last] < 0:
        return np.empty((0, 2), np.int64)
    return _way_back(parent, first, last, columns)


@compiled(nogil=True)
def line_cost(ground: Ground, prices: Prices, place: Place, a: Floats, b: Floats) -> float:
    """Cost of the straight line from a to b, metres times cost per metre; negative if not clear, or not permitted."""
    field, unknown, courses, guide = ground
    resolution_m, ox, oy = place
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    course = course_of(b[0] - a[0], b[1] - a[1])
    steps = max(1, math.ceil(length / resolution_m))
    total = 0.0
    for i in range(steps):
        t = (i + 0.5) / steps
        c = math.floor((a[0] + t * (b[0] - a[0]) - ox) / resolution_m)
        r = math.floor((a[1] + t * (b[1] - a[1]) - oy) / resolution_m)
        if r < 0 or c < 0 or r >= field.shape[0] or c >= field.shape[1]:
            return -1.0
        if not permits(courses, r, c, course):
            return -1.0
        cost = _cell_cost(float(field[r, c]), unknown[r, c], prices)
        if cost < 0.0:
            return -1.0
        if guide.shape[0] > 0:
            if guide[r, c] < 0.0:
                return -1.0
            cost += float(guide[r, c])
        total += cost * length / steps
    return total


@compiled(nogil=True)
def straighten(ground: Ground, prices: Prices, place: Place, points: Floats, longest: int) -> Floats:
    """(m, 2) points with straight lines wherever one is clear and costs no more than the steps it replaces.

    points: (n, 2). A step that is not clear itself (out of a tight spot) is kept. longest: steps per line.
    """
    n = len(points)
    keep = np.empty(n, np.int64)
    keep[0] = 0
    count, anchor = 1, 0
    while anchor < n - 1:
        best, along, j = anchor + 1, 0.0, anchor + 1
        misses = 0
        while j < n and j - anchor <= longest:
            step = line_cost(ground, prices, place, points[j - 1], points[j])
            if step < 0.0:
                break
            along += step
            line = line_cost(ground, prices, place, points[anchor], points[j])
            if 0.0 <= line <= along * 1.001 + 1e-9:
                best, misses = j, 0
            else:
                misses += 1
                if misses > 12:
                    break
            j += 1
        keep[count] = best
        count += 1
        anchor = best
    out = np.empty((count, 2))
    for k in range(count):
        out[k] = points[keep[k]]
    return out


@compiled(nogil=True)
def line_permits(courses: Courses, resolution_m: float, ox: float, oy: float, a: Floats, b: Floats) -> bool:
    """Whether the cells on the straight line from a to b permit its course."""
    if courses.shape[0] == 0 or (a[0] == b[0] and a[1] == b[1]):
        return True
    course = course_of(b[0] - a[0], b[1] - a[1])
    steps = max(1, math.ceil(math.hypot(b[0] - a[0], b[1] - a[1]) / resolution_m))
    for i in range(steps + 1):
        x, y = a[0] + (b[0] - a[0]) * i / steps, a[1] + (b[1] - a[1]) * i / steps
        if not permits(courses, math.floor((y - oy) / resolution_m), math.floor((x - ox) / resolution_m), course):
            return False
    return True


@compiled(nogil=True)
def relax(
    field: Singles, resolution_m: float, ox: float, oy: float, points: Floats, radius_m: float, rounds: int,
    courses: Courses,
) -> Floats:  # fmt: skip
    """Rounds the corners of (n, 2) points: each moves to its neighbours' middle where that stays clear; ends stay.

    No point moves where the courses from and to its neighbours are not permitted.
    """
    out = points.copy()
    for _ in range(rounds):
        for i in range(1, len(out) - 1):
            x, y = 0.5 * (out[i - 1, 0] + out[i + 1, 0]), 0.5 * (out[i - 1, 1] + out[i + 1, 1])
            here = clearance_at(field, resolution_m, ox, oy, out[i, 0], out[i, 1])
            there = clearance_at(field, resolution_m, ox, oy, x, y)
            clear = there >= radius_m and (there >= here - resolution_m or there > 2.0 * radius_m)
            if clear and line_permits(courses, resolution_m, ox, oy, out[i - 1], out[i + 1]):
                out[i, 0], out[i, 1] = x, y
    return out


@compiled(nogil=True)
def headings(
    room: Rooms, requested: Floats, step_m: Floats, first: int, last: int, turn_cost: float, tight_cost: float
) -> npt.NDArray[np.int64]:
    """The cheapest heading for every point of a way (Viterbi): along the way if that is clear, turning little.

    room: (n, h) of ``heading_room`` at point i with heading k * 2 pi / h. requested: (n,) course of the way, rad.
    step_m: (n,) from the point before. first, last: given headings. turn_cost: m per radian. tight_cost: m per metre.
    Returns (n,) headings; where that is impossible, (2,) of -1 and the first point that cannot be passed.
    """
    n, h = room.shape
    unit = 2.0 * math.pi / h
    cost = np.full(h, np.inf)
    cost[first] = 0.0
    back = np.zeros((n, h), np.int64)
    new = np.empty(h)
    for i in range(1, n):
        any_free = False
        new[:] = np.inf
        for k in range(h):
            if room[i, k] == CLOSED:
                continue
            here = step_m[i] * (1.0 - math.cos(k * unit - requested[i]))
            if room[i, k] == TIGHT:
                here += step_m[i] * tight_cost
            # The turn happens at this point; all headings it passes must be clear.
            for sign in (-1, 1):
                for turn in range(0 if sign > 0 else 1, h // 2 + 1):
                    source = (k + sign * turn) % h
                    if room[i, source] == CLOSED:
                        break
                    total = cost[source] + here + turn_cost * unit * turn
                    if total < new[k]:
                        new[k] = total
                        back[i, k] = source
            any_free = any_free or new[k] < np.inf
        if not any_free:
            return np.array([-1, i])
        cost[:] = new
    if cost[last] == np.inf:
        return np.array([-1, n - 1])
    out = np.empty(n, np.int64)
    at = last
    for i in range(n - 1, 0, -1):
        out[i] = at
        at = back[i, at]
    out[0] = first
    return out


@compiled(nogil=True)
def heading_room(
    field: Singles, resolution_m: float, ox: float, oy: float, outline: Floats, points: Floats, count: int,
    margin_m: Floats, easy_m: float, reach_m: float, inner_m: float,
) -> Rooms:  # fmt: skip
    """(n, count) the outline's room at each point and heading: CLOSED below margin_m (n,), TIGHT below easy_m, EASY.

    reach_m: largest distance of the outline from base_link; with more clearance every heading is easy. inner_m: the
    smallest; with less clearance every heading is closed.
    """
    n = len(points)
    room = np.full((n, count), EASY, np.int8)
    pose = np.empty(3)
    for i in range(n):
        here = clearance_at(field, resolution_m, ox, oy, points[i, 0], points[i, 1])
        if here > reach_m + max(margin_m[i], easy_m) + resolution_m:
            continue
        if here < inner_m and margin_m[i] > 0.0:
            room[i] = CLOSED
            continue
        for k in range(count):
            pose[0], pose[1], pose[2] = points[i, 0], points[i, 1], 2.0 * math.pi * k / count
            clear = footprint_clearance(field, resolution_m, ox, oy, outline, pose, 0.0)
            if clear < margin_m[i]:
                room[i, k] = CLOSED
            elif clear < easy_m:
                room[i, k] = TIGHT
    return room
