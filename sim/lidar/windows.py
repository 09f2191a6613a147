"""Beams that can hit a solid: its angular window at a turning sensor, compiled."""

from __future__ import annotations

import math

from robot_stack.core.compiled import compiled
from sim.lidar.shapes import F64, I64, Beams

# Margin for rounding at the edge of a solid, beside that for motion.
_PAD_RAD = 1e-4


@compiled(error_model="numpy")
def window_of(first: int, last: int, beams: Beams, place: F64, shape: F64, half: F64, window: I64) -> bool:
    """The columns and rings of a block that can meet a box (from, behind, from, behind); False if none."""
    azimuths, elevations, origins, rotations, max_m = beams
    middle = (first + last) // 2
    origin, rotation = origins[middle], rotations[middle]
    rings = len(elevations)
    window[0], window[1], window[2], window[3] = first, last, 0, rings
    nearest, farthest = _distances(origin, place, shape, half)
    step_m, turn = _motion(first, last, middle, origins, rotations)
    if nearest > max_m + step_m:
        return False
    if nearest < 2.0 * step_m + 1e-3:
        return True
    ax, ay, az = place[0] - origin[0], place[1] - origin[1], place[2] - origin[2]
    x0 = rotation[0, 0] * ax + rotation[1, 0] * ay + rotation[2, 0] * az
    y0 = rotation[0, 1] * ax + rotation[1, 1] * ay + rotation[2, 1] * az
    towards = math.atan2(y0, x0)
    pad = _PAD_RAD + turn + step_m / (nearest - step_m)
    step = (azimuths[first] - azimuths[last - 1]) / max(1, last - 1 - first) if last - first > 1 else 1e-3
    offset = towards - azimuths[middle]
    offset -= 2.0 * math.pi * math.floor(offset / (2.0 * math.pi) + 0.5)
    # Most solids lie elsewhere: their bounding sphere excludes them without a test of their corners.
    reach, flat = math.sqrt(half[0] ** 2 + half[1] ** 2 + half[2] ** 2), math.sqrt(x0 * x0 + y0 * y0)
    if reach < flat and abs(offset) > math.asin(reach / flat) + pad + (0.5 * (last - first) + 1.0) * step:
        return False
    cos0, sin0 = math.cos(towards), math.sin(towards)
    left, right, low, high = -10.0, 10.0, 1e9, -1e9
    for corner in range(8):
        a = half[0] if corner & 1 else -half[0]
        b = half[1] if corner & 2 else -half[1]
        c = half[2] if corner & 4 else -half[2]
        mx = ax + shape[0, 0] * a + shape[0, 1] * b + shape[0, 2] * c
        my = ay + shape[1, 0] * a + shape[1, 1] * b + shape[1, 2] * c
        mz = az + shape[2, 0] * a + shape[2, 1] * b + shape[2, 2] * c
        x = rotation[0, 0] * mx + rotation[1, 0] * my + rotation[2, 0] * mz
        y = rotation[0, 1] * mx + rotation[1, 1] * my + rotation[2, 1] * mz
        z = rotation[0, 2] * mx + rotation[1, 2] * my + rotation[2, 2] * mz
        angle = math.atan2(cos0 * y - sin0 * x, cos0 * x + sin0 * y)
        left, right = max(left, angle), min(right, angle)
        low, high = min(low, z), max(high, z)
    if left - right > math.pi - 0.3 - 2.0 * pad:
        return True  # the sensor's axis goes through it, or nearly
    window[0] = max(first, math.ceil(middle - (offset + left + pad) / step))
    window[1] = min(last, math.floor(middle - (offset + right - pad) / step) + 1)
    if window[0] >= window[1]:
        return False
    # sin(elevation) = z / distance, bounded from what is known of both.
    top = high / (nearest if high > 0.0 else farthest)
    bottom = low / (nearest if low < 0.0 else farthest)
    spacing = (elevations[rings - 1] - elevations[0]) / (rings - 1)
    upper = math.asin(min(1.0, max(-1.0, top))) + pad
    lower = math.asin(min(1.0, max(-1.0, bottom))) - pad
    window[2] = max(0, math.ceil((lower - elevations[0]) / spacing))
    window[3] = min(rings, math.floor((upper - elevations[0]) / spacing) + 1)
    return bool(window[2] < window[3])


@compiled(error_model="numpy")
def _motion(first: int, last: int, middle: int, origins: F64, rotations: F64) -> tuple[float, float]:
    """Largest motion (m) and turn (rad) of the sensor between the middle of a block and its ends."""
    step_m, turn = 0.0, 0.0
    for end in (first, last - 1):
        moved, trace = 0.0, 0.0
        for i in range(3):
            moved += (origins[end, i] - origins[middle, i]) ** 2
            for j in range(3):
                trace += rotations[end, i, j] * rotations[middle, i, j]
        step_m = max(step_m, math.sqrt(moved))
        turn = max(turn, math.sqrt(max(0.0, 3.0 - trace)))
    return step_m, 1.05 * turn


@compiled(error_model="numpy")
def _distances(origin: F64, place: F64, shape: F64, half: F64) -> tuple[float, float]:
    """From a point to the nearest and to the farthest point of a box, m."""
    near2, far2 = 0.0, 0.0
    for k in range(3):
        local = 0.0
        for i in range(3):
            local += shape[i, k] * (origin[i] - place[i])
        outside = max(0.0, abs(local) - half[k])
        near2 += outside * outside
        far2 += (abs(local) + half[k]) ** 2
    return math.sqrt(near2), math.sqrt(far2)
