"""The compiled ray caster of the backdrop."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_FAR = 1.0e4
_HAZE_M = 120.0
_SKY, _HAZE = 0.80, 0.74
_GROUND = 0.36
_AMBIENT, _DIRECT = 0.55, 0.60


@compiled(inline="always")
def _noise(x: float, y: float, texture: F32) -> float:
    size = texture.shape[0]
    return float(texture[math.floor(y) & (size - 1), math.floor(x) & (size - 1)])


@compiled(inline="always")
def _paint(across: float, up: float, reflectance: float, kind: float, far_m: float, texture: F32) -> float:
    """Reflectance of a surface at a place (m) on it; texture fades where a pixel covers much of it."""
    if kind == 1.0:  # windows: dark squares in rows
        i, j = across * 0.7, up * 0.8
        i, j = i - math.floor(i), j - math.floor(j)
        if 0.3 < i < 0.75 and 0.25 < j < 0.8:
            return 0.35 * reflectance
    strength = 0.30 if kind == 2.0 else 0.12
    grain = _noise(across * 40.0, up * 40.0, texture) / (1.0 + 0.3 * far_m)
    return reflectance * (1.0 + strength * (grain + _noise(across * 6.0, up * 6.0, texture)))


@compiled
def _enter_box(o: F64, d: F64, half: F64) -> tuple[float, int]:
    """Distance along d at which a ray enters a box, and the axis of the face; _FAR if it misses."""
    near, far, axis = -_FAR, _FAR, 0
    for k in range(3):
        if abs(d[k]) < 1e-12:
            if abs(o[k]) > half[k]:
                return _FAR, 0
            continue
        a, b = (-half[k] - o[k]) / d[k], (half[k] - o[k]) / d[k]
        if a > b:
            a, b = b, a
        if a > near:
            near, axis = a, k
        far = min(far, b)
    if near > far or near <= 0.0:
        return _FAR, 0
    return near, axis


@compiled
def _enter_cylinder(o: F64, d: F64, half: F64) -> float:
    """Distance along d at which a ray meets the side of an upright cylinder; _FAR if it misses."""
    a = d[0] * d[0] + d[1] * d[1]
    b = o[0] * d[0] + o[1] * d[1]
    c = o[0] * o[0] + o[1] * o[1] - half[0] * half[0]
    root = b * b - a * c
    if a < 1e-12 or root <= 0.0 or c <= 0.0:
        return _FAR
    s = (-b - math.sqrt(root)) / a
    if s <= 0.0 or abs(o[2] + s * d[2]) > half[2]:
        return _FAR
    return float(s)


@compiled
def cast_backdrop(
    rays: F32,
    camera: F64,
    inverse: F64,
    shapes: F64,
    windows: NDArray[np.int64],
    sun: F64,
    texture: F32,
    grey: F32,
    depth: F32,
) -> None:
    """Fills grey (reflectances) and depth (m along the optical axis).

    rays: (h, w, 2) normalized coordinates. camera: (4, 4) in map. inverse: (n, 4, 4) map in each solid's frame.
    shapes: rows of ``scenery.SHAPE_SIZE``. windows: (n, 4) rows and columns to look at. sun: direction to it.
    """
    turn = np.ascontiguousarray(camera[:3, :3])
    height_m = camera[2, 3]
    for row in range(rays.shape[0]):
        for column in range(rays.shape[1]):
            x, y = rays[row, column, 0], rays[row, column, 1]
            dx = turn[0, 0] * x + turn[0, 1] * y + turn[0, 2]
            dy = turn[1, 0] * x + turn[1, 1] * y + turn[1, 2]
            dz = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2]
            if dz < -1e-4 and height_m > 0.0:
                s = -height_m / dz
                gx, gy = camera[0, 3] + s * dx, camera[1, 3] + s * dy
                grain = _noise(gx * 60.0, gy * 60.0, texture) / (1.0 + 0.5 * s)
                paint = _GROUND * (1.0 + 0.35 * grain + 0.12 * _noise(gx * 4.0, gy * 4.0, texture))
                haze = min(1.0, s / _HAZE_M)
                grey[row, column] = np.float32(paint * (1.0 - haze) + _HAZE * haze)
                depth[row, column] = np.float32(min(s, _FAR))
            else:
                rise = dz / math.sqrt(dx * dx + dy * dy + 1e-9)
                cloud = _noise(40.0 * dx / (0.2 + rise), 40.0 * dy / (0.2 + rise), texture) if rise > 0.0 else 0.0
                grey[row, column] = np.float32(_HAZE + (_SKY - _HAZE) * min(1.0, rise) + 0.04 * cloud)
                depth[row, column] = np.float32(_FAR)
    o, d, origin = np.empty(3), np.empty(3), camera[:3, 3]
    for n in range(shapes.shape[0]):
        move = inverse[n]
        half = shapes[n, 1:4]
        spin = np.ascontiguousarray(move[:3, :3])
        local = spin @ turn
        for k in range(3):
            o[k] = spin[k, 0] * origin[0] + spin[k, 1] * origin[1] + spin[k, 2] * origin[2] + move[k, 3]
        light = spin @ sun
        for row in range(windows[n, 0], windows[n, 1]):
            for column in range(windows[n, 2], windows[n, 3]):
                x, y = rays[row, column, 0], rays[row, column, 1]
                for k in range(3):
                    d[k] = local[k, 0] * x + local[k, 1] * y + local[k, 2]
                if shapes[n, 0] == 0.0:
                    s, axis = _enter_box(o, d, half)
                else:
                    s, axis = _enter_cylinder(o, d, half), 3
                if s >= depth[row, column]:
                    continue
                px, py, pz = o[0] + s * d[0], o[1] + s * d[1], o[2] + s * d[2]
                if axis == 3:
                    facing = (px * light[0] + py * light[1]) / half[0]
                    across, up = math.atan2(py, px) * half[0], pz
                elif axis == 2:
                    facing = light[2] * (1.0 if pz > 0.0 else -1.0)
                    across, up = px, py
                elif axis == 0:
                    facing = light[0] * (1.0 if px > 0.0 else -1.0)
                    across, up = py, pz
                else:
                    facing = light[1] * (1.0 if py > 0.0 else -1.0)
                    across, up = px, pz
                paint = _paint(across, up, shapes[n, 4], shapes[n, 5], s, texture)
                depth[row, column] = np.float32(s)
                grey[row, column] = np.float32(paint * (_AMBIENT + _DIRECT * max(0.0, facing)))
