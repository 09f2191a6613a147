"""The compiled loops that draw a marker panel, by exact inverse mapping.

A panel's map is a homography from the normalized coordinates (x, y) of a ray to its place (u, v) on the panel:
u = (a . r) / (c . r), v = (b . r) / (c . r) with r = (x, y, 1); depth = -o_z / (c . r). Its ten numbers are a, b, c and
-o_z. They are given at equal steps of time and are linear in between.

The corners of the pixels are labelled with the reflectance found there, in runs that are known to stay within one cell.
A pixel whose corners agree shows that reflectance; any other lies on an edge (``edges``).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from sim.camera.dirt import soiled
from sim.camera.edges import BESIDE, many_edges, one_edge

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_GRAZING = 1e-9
# The map's change per pixel is taken at both ends and the middle of a row; this margin covers the rest.
_RATE_MARGIN = 1.15
_SMALLEST_RATE = 1e-6
_HIDDEN_M = 0.03


@compiled
def _look(
    u: float, v: float, rect: F64, rim: float, grids: F64, cells: F32, per_u: float, per_v: float
) -> tuple[float, int]:
    """Reflectance at a place, and the pixels that can be crossed from there before it can change, at least 1.

    per_u, per_v: pixels per metre, at least.
    """
    beside = max(max(rect[0] - u, u - rect[1]) * per_u, max(rect[2] - v, v - rect[3]) * per_v)
    if beside > 0.0:
        return BESIDE, max(1, int(beside))
    steps = min(min(u - rect[0], rect[1] - u) * per_u, min(v - rect[2], rect[3] - v) * per_v)
    n = cells.shape[1]
    for m in range(grids.shape[0]):
        cell_u, cell_v = per_u / grids[m, 2], per_v / grids[m, 2]
        i, j = (u - grids[m, 0]) * grids[m, 2], (grids[m, 1] - v) * grids[m, 2]
        if 0.0 <= i < n and 0.0 <= j < n:
            k, q = int(i), int(j)
            part_i, part_j = i - k, j - q
            steps = min(min(part_i, 1.0 - part_i) * cell_u, min(part_j, 1.0 - part_j) * cell_v)
            return float(cells[m, q, k]), max(1, int(steps))
        steps = min(steps, max(max(-i, i - n) * cell_u, max(-j, j - n) * cell_v))
    return rim, max(1, int(steps))


@compiled
def map_at(time_s: float, maps: F64, first_s: float, step_s: float, out: F64) -> None:
    """The map's ten numbers at a time."""
    where = (time_s - first_s) / step_s
    k = min(max(int(where), 0), maps.shape[0] - 2)
    part = where - k
    for i in range(10):
        out[i] = maps[k, i] + part * (maps[k + 1, i] - maps[k, i])


@compiled
def _place(x: float, y: float, h: F64) -> tuple[float, float, bool]:
    """(u, v) where a ray meets the panel's plane; False if it does not."""
    w = h[6] * x + h[7] * y + h[8]
    if w * h[9] <= _GRAZING:
        return 0.0, 0.0, False
    return (h[0] * x + h[1] * y + h[2]) / w, (h[3] * x + h[4] * y + h[5]) / w, True


@compiled
def _row_rates(ray: F32, h: F64, col0: int, col1: int) -> tuple[float, float]:
    """The least pixels per metre of u and of v along a row; 0 where the map ends."""
    rate_u, rate_v = _SMALLEST_RATE, _SMALLEST_RATE
    for column in (col0, (col0 + col1) // 2, col1 - 1):
        u0, v0, there0 = _place(ray[column, 0], ray[column, 1], h)
        u1, v1, there1 = _place(ray[column + 1, 0], ray[column + 1, 1], h)
        if not (there0 and there1):
            return 0.0, 0.0
        rate_u, rate_v = max(rate_u, abs(u1 - u0)), max(rate_v, abs(v1 - v0))
    rate_u, rate_v = rate_u * _RATE_MARGIN, rate_v * _RATE_MARGIN
    # Distortion bends a row that is level at its ends and its middle.
    return 1.0 / max(rate_u, 0.05 * rate_v), 1.0 / max(rate_v, 0.05 * rate_u)


@compiled
def _label_row(
    ray: F32, h: F64, col0: int, col1: int, rect: F64, rim: float, grids: F64, cells: F32, labels: F64, ends: I64
) -> None:
    """Labels of the corners col0..col1 of one row, and for each the index after its run."""
    per_u, per_v = _row_rates(ray, h, col0, col1)
    count = col1 - col0 + 1
    i = 0
    while i < count:
        u, v, there = _place(ray[col0 + i, 0], ray[col0 + i, 1], h)
        label, steps = BESIDE, 1
        if there:
            label, steps = _look(u, v, rect, rim, grids, cells, per_u, per_v)
        end = min(i + steps, count)
        for k in range(i, end):
            labels[k] = label
            ends[k] = end
        i = end


@compiled
def _corner_places(ray0: F32, ray1: F32, column: int, early: F64, late: F64, u: F64, v: F64) -> bool:
    """Fills u, v (2, 4) with the places of a pixel's corners at both ends of the exposure; False beyond the horizon."""
    for k in range(4):
        ray = ray1 if k >= 2 else ray0
        x, y = ray[column + (k & 1), 0], ray[column + (k & 1), 1]
        u[0, k], v[0, k], there = _place(x, y, early)
        u[1, k], v[1, k], still_there = _place(x, y, late)
        if not (there and still_there):
            return False
    return True


@compiled
def _shade(
    value: float, x: float, y: float, pixel: float, h: F64, light: F64, grids: F64, n: int, dirt: F32, soil: float
) -> float:
    """Grey levels of a reflectance under light that varies over the panel, through the dirt on it."""
    u, v, there = _place(x, y, h)
    if not there:
        return float(value * light[0])
    du, dv = u - light[3], v - light[4]
    bright = light[0] * max(0.0, 1.0 + light[1] * du + light[2] * dv)
    if light[5] > 0.0:
        # At least as wide as a pixel, to avoid aliasing of a hard edge.
        soft = max(light[9], pixel * abs(h[9] / (h[6] * x + h[7] * y + h[8])))
        part = (light[6] * du + light[7] * dv - light[8]) / soft + 0.5
        bright *= 1.0 - light[5] * min(1.0, max(0.0, part))
    if dirt.shape[0] > 0:
        value = soiled(u, v, value, grids, n, dirt, soil)
    return float(value * bright)


@compiled
def draw_panel(
    image: F32,
    rays: F32,
    window: I64,
    maps: F64,
    clock: F64,
    rect: F64,
    rim: float,
    grids: F64,
    cells: F32,
    samples: F32,
    light: F64,
    dirt: F32,
    soil: float,
    depth: F32,
    divisor: int,
    farthest_m: float,
) -> None:
    """Draws one panel into an image of grey levels.

    rays: (H+1, W+1, 2) normalized coordinates of the pixels' corners. window: first and last + 1 row and column.
    maps: (k, 10). clock: time of the first map, step between maps, time of row 0, row time, exposure, 1 if anything
    moves. rect, rim, grids, cells: of the panel (``panels.Panel``). samples: (n, 3) places in a pixel and in the
    exposure, 0..1. light: grey levels of reflectance 1; gradient right and up per m; middle u, v; shadow depth, normal
    u, v, offset, softness. dirt: (m, k, k) shares or empty; soil: its reflectance. depth: of what stands in the world,
    at 1 / divisor of the resolution. farthest_m: depth of the panel's farthest point.
    """
    row0, row1, col0, col1 = window[0], window[1], window[2], window[3]
    moving = clock[5] > 0.5
    early, middle, late = np.empty(10), np.empty(10), np.empty(10)
    u, v = np.empty((2, 4)), np.empty((2, 4))
    half_s = 0.5 * clock[4] if moving else 0.0
    count = col1 - col0 + 1
    labels, ends = np.empty((2, 2, count)), np.empty((2, 2, count), np.int64)  # above and below; early and late
    shaded = light[1] != 0.0 or light[2] != 0.0 or light[5] > 0.0 or dirt.shape[0] > 0
    hidden, hidden_row = False, -1
    last = 1 if moving else 0
    for row in range(row0 - 1, row1):
        time_s = clock[2] + row * clock[3]
        map_at(time_s, maps, clock[0], clock[1], middle)
        map_at(time_s - half_s, maps, clock[0], clock[1], early)
        map_at(time_s + half_s, maps, clock[0], clock[1], late)
        above, below = row & 1, 1 - (row & 1)
        ray0, ray1 = rays[max(row, 0)], rays[row + 1]
        _label_row(ray1, early, col0, col1, rect, rim, grids, cells, labels[below, 0], ends[below, 0])
        if moving:
            _label_row(ray1, late, col0, col1, rect, rim, grids, cells, labels[below, 1], ends[below, 1])
        if row < row0:
            continue
        if row // divisor != hidden_row:
            hidden_row = row // divisor
            nearest = np.float32(np.inf)
            for k in range(col0 // divisor, min(col1 // divisor + 1, depth.shape[1])):
                nearest = min(nearest, depth[hidden_row, k])
            hidden = bool(nearest < farthest_m - _HIDDEN_M)
        i = 0
        while i < count - 1:
            value = labels[above, 0, i]
            end = min(ends[above, 0, i], ends[below, 0, i], ends[above, last, i], ends[below, last, i]) - 1
            same = value == labels[below, 0, i] == labels[above, last, i] == labels[below, last, i]
            if end <= i:
                end = i + 1
                same = same and value == labels[above, 0, end] == labels[below, 0, end]
                same = same and value == labels[above, last, end] == labels[below, last, end]
            elif not same:
                end = i + 1
            if same and value == BESIDE:
                i = end
                continue
            if same and not shaded and not hidden:
                image[row, col0 + i : col0 + end] = np.float32(value * light[0])
                i = end
                continue
            for column in range(col0 + i, col0 + end):
                x = 0.25 * (ray0[column, 0] + ray0[column + 1, 0] + ray1[column, 0] + ray1[column + 1, 0])
                y = 0.25 * (ray0[column, 1] + ray0[column + 1, 1] + ray1[column, 1] + ray1[column + 1, 1])
                if hidden:
                    w = middle[6] * x + middle[7] * y + middle[8]
                    if w != 0.0 and depth[hidden_row, column // divisor] < middle[9] / w - _HIDDEN_M:
                        continue
                seen, shown = 1.0, value
                if not same:
                    if not _corner_places(ray0, ray1, column, early, late, u, v):
                        continue
                    simple, seen, shown = one_edge(u, v, moving, rect, rim, grids, cells)
                    if not simple:
                        seen, shown = many_edges(row, column, u, v, moving, rect, rim, grids, cells, samples)
                    if seen == 0.0:
                        continue
                if shaded:
                    pixel = ray0[column + 1, 0] - ray0[column, 0]
                    shown = _shade(shown, x, y, pixel, middle, light, grids, cells.shape[1], dirt, soil)
                else:
                    shown *= light[0]
                image[row, column] = np.float32(seen * shown + (1.0 - seen) * image[row, column])
            i = end
