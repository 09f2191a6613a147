"""Pixels crossed by an edge: their share of each side.

One straight edge through a pixel is integrated exactly, also over the exposure; a pixel with several edges is sampled.
Inside a pixel the place (u, v) on the panel is bilinear in the place in the pixel and linear in time. Corners are
numbered 0 upper left, 1 upper right, 2 lower left, 3 lower right; u, v are (2, 4): begin and end of the exposure.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
BESIDE = -1.0  # label of a place beside the panel
_FLAT = 1e-30  # slopes whose products would underflow or be NaN
_SMALL_SHIFT = 1e-3  # px: an edge with less motion is static


@compiled
def reflectance(u: float, v: float, rect: F64, rim: float, grids: F64, cells: F32) -> float:
    """Reflectance of the panel at a place, BESIDE outside it."""
    if u < rect[0] or u > rect[1] or v < rect[2] or v > rect[3]:
        return BESIDE
    n = cells.shape[1]
    for m in range(grids.shape[0]):
        i = (u - grids[m, 0]) * grids[m, 2]
        j = (grids[m, 1] - v) * grids[m, 2]
        if 0.0 <= i < n and 0.0 <= j < n:
            return float(cells[m, int(j), int(i)])
    return rim


@compiled
def half_plane(middle: float, across: float, down: float) -> float:
    """Share of a unit square in which f > 0, for f with a value in the middle and a slope across and down."""
    a, b = abs(across), abs(down)
    if a < b:
        a, b = b, a
    reach = 0.5 * (a + b) - abs(middle)
    if reach <= _FLAT:
        return 1.0 if middle > 0.0 else 0.0
    if abs(middle) <= 0.5 * (a - b):
        return 0.5 + middle / a
    corner = 0.5 * reach * reach / (a * b)
    return 1.0 - corner if middle > 0.0 else corner


@compiled
def _summed(middle: float, a: float, b: float) -> float:
    """Integral of ``half_plane`` over the value in the middle from minus infinity, slopes a >= b >= 0."""
    if middle > 0.0:  # the share and that of the other side add up to one
        return middle + _summed_below(-middle, a, b)
    return _summed_below(middle, a, b)


@compiled
def _summed_below(middle: float, a: float, b: float) -> float:
    outer, inner = 0.5 * (a + b), 0.5 * (a - b)
    if middle <= -outer or a <= _FLAT:
        return 0.0
    if middle <= -inner and b > _FLAT:
        return (middle + outer) ** 3 / (6.0 * a * b)
    return b * b / (6.0 * a) + 0.5 * (middle + inner) + 0.5 * (middle * middle - inner * inner) / a


@compiled
def moving_half_plane(middle: float, shift: float, across: float, down: float) -> float:
    """Mean of ``half_plane`` while the value in the middle goes evenly from ``middle`` to ``middle + shift``."""
    a, b = max(abs(across), abs(down)), min(abs(across), abs(down))
    if abs(shift) <= _SMALL_SHIFT * max(a, abs(middle)):
        return half_plane(middle + 0.5 * shift, across, down)
    return (_summed(middle + shift, a, b) - _summed(middle, a, b)) / shift


@compiled
def _beyond(places: F64, edge: float, moving: bool) -> float:
    """Share of a pixel and its exposure in which a coordinate is above ``edge``. places: (2, 4) at the corners."""
    p = places[0]
    middle = 0.25 * (p[0] + p[1] + p[2] + p[3]) - edge
    across, down = 0.5 * (p[1] + p[3] - p[0] - p[2]), 0.5 * (p[2] + p[3] - p[0] - p[1])
    if not moving:
        return half_plane(middle, across, down)
    q = places[1]
    shift = 0.25 * (q[0] + q[1] + q[2] + q[3]) - edge - middle
    return moving_half_plane(middle, shift, across, down)


@compiled
def _bounds(places: F64, moving: bool) -> tuple[float, float]:
    low, high = places[0, 0], places[0, 0]
    for k in range(2 if moving else 1):
        for c in range(4):
            low, high = min(low, places[k, c]), max(high, places[k, c])
    return low, high


@compiled
def _cell(m: int, i: int, j: int, rim: float, cells: F32) -> float:
    n = cells.shape[1]
    return float(cells[m, j, i]) if 0 <= i < n and 0 <= j < n else rim


@compiled
def one_edge(u: F64, v: F64, moving: bool, rect: F64, rim: float, grids: F64, cells: F32) -> tuple[bool, float, float]:
    """(True, share of the pixel that the panel covers, mean reflectance of that share) for a pixel with one edge."""
    low_u, high_u = _bounds(u, moving)
    low_v, high_v = _bounds(v, moving)
    if low_u > rect[0] and high_u < rect[1] and low_v > rect[2] and high_v < rect[3]:
        return _inner_edge(u, v, low_u, high_u, low_v, high_v, moving, rim, grids, cells)
    if low_v > rect[2] and high_v < rect[3]:
        if low_u < rect[0] < high_u < rect[1]:
            return True, _beyond(u, rect[0], moving), rim
        if rect[0] < low_u < rect[1] < high_u:
            return True, 1.0 - _beyond(u, rect[1], moving), rim
    if low_u > rect[0] and high_u < rect[1]:
        if low_v < rect[2] < high_v < rect[3]:
            return True, _beyond(v, rect[2], moving), rim
        if rect[2] < low_v < rect[3] < high_v:
            return True, 1.0 - _beyond(v, rect[3], moving), rim
    return False, 0.0, 0.0


@compiled
def _inner_edge(
    u: F64,
    v: F64,
    low_u: float,
    high_u: float,
    low_v: float,
    high_v: float,
    moving: bool,
    rim: float,
    grids: F64,
    cells: F32,
) -> tuple[bool, float, float]:
    n = cells.shape[1]
    for m in range(grids.shape[0]):
        scale = grids[m, 2]
        i0, i1 = math.floor((low_u - grids[m, 0]) * scale), math.floor((high_u - grids[m, 0]) * scale)
        j0, j1 = math.floor((grids[m, 1] - high_v) * scale), math.floor((grids[m, 1] - low_v) * scale)
        if i1 < 0 or i0 >= n or j1 < 0 or j0 >= n:
            continue
        if i1 - i0 > 1 or j1 - j0 > 1:
            return False, 0.0, 0.0
        a, b = _cell(m, i0, j0, rim, cells), _cell(m, i1, j0, rim, cells)
        c, d = _cell(m, i0, j1, rim, cells), _cell(m, i1, j1, rim, cells)
        if a == c and b == d:  # an upright edge between i0 and i1, or none
            part = _beyond(u, grids[m, 0] + i1 / scale, moving)
            return True, 1.0, a + part * (b - a)
        if a == b and c == d:
            part = _beyond(v, grids[m, 1] - j1 / scale, moving)
            return True, 1.0, c + part * (a - c)
        return False, 0.0, 0.0
    return True, 1.0, rim


@compiled
def many_edges(
    row: int, column: int, u: F64, v: F64, moving: bool, rect: F64, rim: float, grids: F64, cells: F32, samples: F32
) -> tuple[float, float]:
    """Share of a pixel that the panel covers, and the mean reflectance of that share, by samples.

    samples: (n, 3) places in a pixel and in the exposure, 0..1. Each pixel shifts them, so that the sampling
    error does not add up along edges.
    """
    mixed = (row * 1973 + column * 9277) & 0xFFFF
    mixed = (mixed * 26699 + 12345) & 0xFFFF
    shift_x, shift_y = mixed / 65536.0, ((mixed * 40503 + 54321) & 0xFFFF) / 65536.0
    total, hits = 0.0, 0
    for k in range(samples.shape[0]):
        sx, sy = samples[k, 0] + shift_x, samples[k, 1] + shift_y
        sx -= math.floor(sx)
        sy -= math.floor(sy)
        a, b, c, d = (1.0 - sx) * (1.0 - sy), sx * (1.0 - sy), (1.0 - sx) * sy, sx * sy
        su = a * u[0, 0] + b * u[0, 1] + c * u[0, 2] + d * u[0, 3]
        sv = a * v[0, 0] + b * v[0, 1] + c * v[0, 2] + d * v[0, 3]
        if moving:
            part = samples[k, 2]
            su += part * (a * u[1, 0] + b * u[1, 1] + c * u[1, 2] + d * u[1, 3] - su)
            sv += part * (a * v[1, 0] + b * v[1, 1] + c * v[1, 2] + d * v[1, 3] - sv)
        found = reflectance(su, sv, rect, rim, grids, cells)
        if found != BESIDE:
            total += found
            hits += 1
    if hits == 0:
        return 0.0, 0.0
    return hits / samples.shape[0], total / hits
