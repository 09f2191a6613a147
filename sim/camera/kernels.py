"""The compiled loops of a picture: panels by exact inverse mapping, and the sensor.

A panel's map is a homography from the normalized coordinates (x, y) of a ray to its place (u, v) on the panel:
u = (a . r) / (c . r), v = (b . r) / (c . r) with r = (x, y, 1); depth = -o_z / (c . r). Its ten numbers are a, b, c and
-o_z. They are given at equal steps of time and are linear in between.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
BACKGROUND = np.float32(-1.0)
# Beyond the image plane's edge of use: a ray that does not meet the panel's front.
_GRAZING = 1e-9


@numba.njit(cache=True, inline="always")
def _reflectance(u: float, v: float, rect: F64, rim: float, grids: F64, cells: F32) -> float:
    """Of the panel at a place, BACKGROUND beside it."""
    if u < rect[0] or u > rect[1] or v < rect[2] or v > rect[3]:
        return BACKGROUND
    n = cells.shape[1]
    for m in range(grids.shape[0]):
        i = (u - grids[m, 0]) * grids[m, 2]
        if 0.0 <= i < n:
            j = (grids[m, 1] - v) * grids[m, 2]
            if 0.0 <= j < n:
                return cells[m, int(j), int(i)]
    return np.float32(rim)


@numba.njit(cache=True, inline="always")
def _maps_at(time_s: float, maps: F64, first_s: float, step_s: float, out: F64) -> None:
    where = (time_s - first_s) / step_s
    k = min(max(int(where), 0), maps.shape[0] - 2)
    part = where - k
    for i in range(10):
        out[i] = maps[k, i] + part * (maps[k + 1, i] - maps[k, i])


@numba.njit(cache=True, inline="always")
def _look(x: float, y: float, h: F64, rect: F64, rim: float, grids: F64, cells: F32) -> float:
    w = h[6] * x + h[7] * y + h[8]
    if w * h[9] <= _GRAZING:  # away from the panel, or the camera is behind it and sees nothing of its front
        return BACKGROUND
    u = (h[0] * x + h[1] * y + h[2]) / w
    v = (h[3] * x + h[4] * y + h[5]) / w
    return _reflectance(u, v, rect, rim, grids, cells)


@numba.njit(cache=True, inline="always")
def _fraction(value: float) -> float:
    return value - math.floor(value)


@numba.njit(cache=True)
def draw_panel(
    image: F32,
    rays: F32,
    window: NDArray[np.int64],
    maps: F64,
    clock: F64,
    rect: F64,
    rim: float,
    grids: F64,
    cells: F32,
    samples: F32,
    light: F64,
    dirt: F32,
    dirt_reflectance: float,
    depth: F32,
    divisor: int,
) -> None:
    """Draws one panel into an image of grey levels.

    rays: (H+1, W+1, 2) normalized coordinates of the pixels' corners. window: first and last + 1 row and column.
    maps: (k, 10). clock: time of the first map, step between maps, time of row 0, row time, exposure, 1 if anything
    moves. samples: (n, 3) places in a pixel and in the exposure, 0..1. light: grey levels of reflectance 1; gradient
    right and up per m; middle u, v; shadow depth, normal u, v, offset, softness. dirt: (m, k, k) or empty.
    depth: of what stands in the world at 1/divisor of the resolution; empty: nothing hides the panel.
    """
    row0, row1, col0, col1 = window[0], window[1], window[2], window[3]
    first_s, step_s, start_s, row_s, exposure_s = clock[0], clock[1], clock[2], clock[3], clock[4]
    moving = clock[5] > 0.5
    early, middle, late = np.empty(10), np.empty(10), np.empty(10)
    width = col1 - col0
    above = np.empty((2, width + 1), np.float32)
    below = np.empty((2, width + 1), np.float32)
    shaded = light[1] != 0.0 or light[2] != 0.0 or light[5] > 0.0 or dirt.shape[0] > 0
    hidden = depth.shape[0] > 0
    count = samples.shape[0]
    for row in range(row0 - 1, row1):
        time_s = start_s + row * row_s
        _maps_at(time_s, maps, first_s, step_s, middle)
        if moving:
            _maps_at(time_s - 0.5 * exposure_s, maps, first_s, step_s, early)
            _maps_at(time_s + 0.5 * exposure_s, maps, first_s, step_s, late)
        above, below = below, above
        for i in range(width + 1):
            x, y = rays[row + 1, col0 + i, 0], rays[row + 1, col0 + i, 1]
            if moving:
                below[0, i] = _look(x, y, early, rect, rim, grids, cells)
                below[1, i] = _look(x, y, late, rect, rim, grids, cells)
            else:
                below[0, i] = _look(x, y, middle, rect, rim, grids, cells)
                below[1, i] = below[0, i]
        if row < row0:
            continue
        for i in range(width):
            column = col0 + i
            value = above[0, i]
            even = value == above[0, i + 1] and value == below[0, i] and value == below[0, i + 1]
            if even and moving:
                even = value == above[1, i] and value == above[1, i + 1]
                even = even and value == below[1, i] and value == below[1, i + 1]
            if even and value == BACKGROUND:
                continue
            seen = 1.0
            x00, y00 = rays[row, column, 0], rays[row, column, 1]
            x01, y01 = rays[row, column + 1, 0], rays[row, column + 1, 1]
            x10, y10 = rays[row + 1, column, 0], rays[row + 1, column, 1]
            x11, y11 = rays[row + 1, column + 1, 0], rays[row + 1, column + 1, 1]
            xm, ym = 0.25 * (x00 + x01 + x10 + x11), 0.25 * (y00 + y01 + y10 + y11)
            wm = middle[6] * xm + middle[7] * ym + middle[8]
            if hidden and wm != 0.0 and depth[row // divisor, column // divisor] < middle[9] / wm - 0.03:
                continue
            if not even:
                # Each pixel shifts the samples: what their finite number leaves does not add up along edges.
                mixed = (row * 1973 + column * 9277) & 0xFFFF
                mixed = (mixed * 26699 + 12345) & 0xFFFF
                shift_x = mixed / 65536.0
                shift_y = ((mixed * 40503 + 54321) & 0xFFFF) / 65536.0
                total, hits = 0.0, 0
                for k in range(count):
                    sx, sy = _fraction(samples[k, 0] + shift_x), _fraction(samples[k, 1] + shift_y)
                    top_x, top_y = x00 + sx * (x01 - x00), y00 + sx * (y01 - y00)
                    low_x, low_y = x10 + sx * (x11 - x10), y10 + sx * (y11 - y10)
                    x, y = top_x + sy * (low_x - top_x), top_y + sy * (low_y - top_y)
                    if moving:
                        part = samples[k, 2]
                        for j in range(10):
                            early_j = early[j]
                            middle[j] = early_j + part * (late[j] - early_j)
                    found = _look(x, y, middle, rect, rim, grids, cells)
                    if found != BACKGROUND:
                        total += found
                        hits += 1
                if moving:
                    _maps_at(time_s, maps, first_s, step_s, middle)
                if hits == 0:
                    continue
                seen = hits / count
                value = np.float32(total / hits)
            bright = light[0]
            if shaded and wm != 0.0:
                u = (middle[0] * xm + middle[1] * ym + middle[2]) / wm
                v = (middle[3] * xm + middle[4] * ym + middle[5]) / wm
                du, dv = u - light[3], v - light[4]
                bright *= max(0.0, 1.0 + light[1] * du + light[2] * dv)
                if light[5] > 0.0:
                    # At least as wide as a pixel, so that a hard edge is no staircase.
                    soft = max(light[9], abs(middle[9] / wm) * abs(x01 - x00))
                    part = (light[6] * du + light[7] * dv - light[8]) / soft + 0.5
                    bright *= 1.0 - light[5] * min(1.0, max(0.0, part))
                if dirt.shape[0] > 0:
                    value = np.float32(_dirty(u, v, value, grids, cells.shape[1], dirt, dirt_reflectance))
            shown = value * bright
            if seen < 1.0:
                image[row, column] = np.float32(image[row, column] * (1.0 - seen) + shown * seen)
            else:
                image[row, column] = np.float32(shown)


@numba.njit(cache=True, inline="always")
def _dirty(u: float, v: float, value: float, grids: F64, n: int, dirt: F32, dirt_reflectance: float) -> float:
    """Reflectance with the dirt at a place mixed in, bilinear in the masks."""
    size = dirt.shape[1]
    for m in range(grids.shape[0]):
        i = (u - grids[m, 0]) * grids[m, 2] / n * size - 0.5
        j = (grids[m, 1] - v) * grids[m, 2] / n * size - 0.5
        if 0.0 <= i < size - 1 and 0.0 <= j < size - 1:
            k, q = int(i), int(j)
            a, b = i - k, j - q
            upper = dirt[m, q, k] * (1.0 - a) + dirt[m, q, k + 1] * a
            lower = dirt[m, q + 1, k] * (1.0 - a) + dirt[m, q + 1, k + 1] * a
            share = upper * (1.0 - b) + lower * b
            return value + share * (dirt_reflectance - value)
    return value


@numba.njit(cache=True)
def expose(
    image: F32,
    gain: float,
    bank: F32,
    offsets: NDArray[np.int64],
    read_dn: float,
    shot_dn: float,
    out: NDArray[np.uint8],
) -> None:
    """Amplifies, adds noise and quantizes. bank: unit normal noise; offsets: (H,) where each row begins in it.

    The noise's variance is (gain read_dn)^2 + gain shot_dn level: electrons arrive one by one.
    """
    read2 = np.float32((gain * read_dn) ** 2)
    shot = np.float32(gain * shot_dn)
    factor = np.float32(gain)
    for row in range(image.shape[0]):
        noise = bank[offsets[row] : offsets[row] + image.shape[1]]
        for column in range(image.shape[1]):
            level = factor * image[row, column]
            level += noise[column] * np.sqrt(read2 + shot * max(level, np.float32(0.0)))
            level = min(max(level, np.float32(0.0)), np.float32(255.0)) + np.float32(0.5)
            out[row, column] = np.uint8(min(level, np.float32(255.0)))
