"""Rays against one solid, compiled: range of its entry, and cosine of the incidence angle."""

from __future__ import annotations

import math

import numpy as np

from robot_stack.core.compiled import compiled
from sim.lidar.shapes import BOX, F64, I64, Beams, Met

Angles = tuple[F64, F64, F64, F64]
"""Cosines and sines of the columns' azimuths, (c,), and of the rings' elevations, (r,)."""
_TINY = 1e-12


@compiled(error_model="numpy")
def meet_window(
    window: I64, kind: int, number: int, beams: Beams, angles: Angles, place: F64, shape: F64, half: F64, met: Met
) -> None:
    """The beams of a window (``window_of``) against one solid, in its own frame."""
    column_cos, column_sin, ring_cos, ring_sin = angles
    ranges, hits, cosines = met
    for c in range(window[0], window[1]):
        # direction = cos(elevation) u + sin(elevation) w
        ox = oy = oz = ux = uy = uz = wx = wy = wz = 0.0
        for i in range(3):
            away = beams.origins[c, i] - place[i]
            u = beams.rotations[c, i, 0] * column_cos[c] + beams.rotations[c, i, 1] * column_sin[c]
            w = beams.rotations[c, i, 2]
            ox += shape[i, 0] * away
            oy += shape[i, 1] * away
            oz += shape[i, 2] * away
            ux += shape[i, 0] * u
            uy += shape[i, 1] * u
            uz += shape[i, 2] * u
            wx += shape[i, 0] * w
            wy += shape[i, 1] * w
            wz += shape[i, 2] * w
        for r in range(window[2], window[3]):
            dx = ring_cos[r] * ux + ring_sin[r] * wx
            dy = ring_cos[r] * uy + ring_sin[r] * wy
            dz = ring_cos[r] * uz + ring_sin[r] * wz
            if kind == BOX:
                far, cosine = _enter_box(ox, oy, oz, dx, dy, dz, half[0], half[1], half[2])
            else:
                far, cosine = _enter_cylinder(ox, oy, oz, dx, dy, dz, half[0], half[2])
            if far < ranges[c, r] and far <= beams.max_m:
                ranges[c, r] = far
                hits[c, r] = number
                cosines[c, r] = cosine


@compiled(error_model="numpy")
def enter(kind: int, origin: F64, beam: F64, place: F64, shape: F64, half: F64) -> tuple[float, float]:
    """Where one ray in map enters one solid, m (inf: it misses), and the cosine to the normal there."""
    ox = oy = oz = dx = dy = dz = 0.0
    for i in range(3):
        away = origin[i] - place[i]
        ox += shape[i, 0] * away
        oy += shape[i, 1] * away
        oz += shape[i, 2] * away
        dx += shape[i, 0] * beam[i]
        dy += shape[i, 1] * beam[i]
        dz += shape[i, 2] * beam[i]
    if kind == BOX:
        return _enter_box(ox, oy, oz, dx, dy, dz, half[0], half[1], half[2])
    return _enter_cylinder(ox, oy, oz, dx, dy, dz, half[0], half[2])


@compiled(error_model="numpy", inline="always")
def safe(value: float) -> float:
    return value if abs(value) > _TINY else _TINY


@compiled(error_model="numpy", inline="always")
def _enter_box(
    ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, hx: float, hy: float, hz: float
) -> tuple[float, float]:
    """Where a ray enters a box, and the cosine to the face's normal; inf if it misses or begins inside."""
    ix, iy, iz = 1.0 / safe(dx), 1.0 / safe(dy), 1.0 / safe(dz)
    nx, ny, nz = -ox * ix - abs(ix) * hx, -oy * iy - abs(iy) * hy, -oz * iz - abs(iz) * hz
    far = min(-ox * ix + abs(ix) * hx, -oy * iy + abs(iy) * hy, -oz * iz + abs(iz) * hz)
    near = max(nx, ny, nz)
    if near > far or near <= 0.0:
        return np.inf, 0.0
    if near == nx:
        return near, abs(dx)
    if near == ny:
        return near, abs(dy)
    return near, abs(dz)


@compiled(error_model="numpy", inline="always")
def _enter_cylinder(
    ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, radius: float, half_height: float
) -> tuple[float, float]:
    """As ``_enter_box`` for an upright cylinder."""
    a = dx * dx + dy * dy
    b = ox * dx + oy * dy
    c = ox * ox + oy * oy - radius * radius
    if c > 0.0:
        root = b * b - a * c
        if root <= 0.0 or b >= 0.0:
            return np.inf, 0.0
        near = (-b - math.sqrt(root)) / a
        if abs(oz + near * dz) <= half_height:
            return near, abs((ox + near * dx) * dx + (oy + near * dy) * dy) / radius
    if abs(oz) <= half_height or oz * dz >= 0.0:
        return np.inf, 0.0
    near = (abs(oz) - half_height) / abs(dz)
    x, y = ox + near * dx, oy + near * dy
    if x * x + y * y <= radius * radius:
        return near, abs(dz)
    return np.inf, 0.0
