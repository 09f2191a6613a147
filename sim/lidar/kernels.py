"""The compiled ray caster: every beam of a spinning sensor against ground, boxes and cylinders.

A beam is known by its column and ring. Each solid is met only by the beams inside its angles as the sensor sees them,
found anew for every block of columns, because sensor and movers go on while the sensor turns. Exact within a block but
for movers, which stand still for the 1.5 ms that a block takes.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from sim.lidar.shapes import BOX, F32, F64, I16, I64

BLOCK = 37  # columns
GROUND_HIT, WET_HIT, PIT_HIT, MIRROR_HIT, FIRST_SOLID = 0, 1, 2, 3, 4
NO_HIT = -1
_TINY = 1e-12
# Beside what motion needs: rounding, at the edge of a solid.
_PAD_RAD = 1e-4


@numba.njit(cache=True, error_model="numpy")
def cast(
    azimuths: F64,
    elevations: F64,
    origins: F64,
    rotations: F64,
    max_m: float,
    rects: F64,
    kind: I64,
    mover: I64,
    centre: F64,
    turned: F64,
    half: F64,
    mover_position: F64,
    mover_rotation: F64,
    ranges: F32,
    hits: I16,
    cosines: F32,
) -> None:
    """First meeting of every beam.

    azimuths: (c,) evenly falling; elevations: (r,) evenly rising, rad. origins (c, 3), rotations (c, 3, 3): the sensor
    in map for each column. rects: (k, 7) centre x, y, cos and sin of yaw, half length, half width, depth: wet ground
    (depth 0) or a pit. kind to half: ``ShapeArrays``. mover_position (b, m, 3), mover_rotation (b, m, 3, 3): a pose per
    block of ``BLOCK`` columns. Results, (c, r): range in m (inf: nothing), what was met, cosine of the angle to its
    normal.
    """
    columns = len(azimuths)
    ring_cos, ring_sin = np.cos(elevations), np.sin(elevations)
    column_cos, column_sin = np.cos(azimuths), np.sin(azimuths)
    shape = np.empty((3, 3))
    place = np.empty(3)
    window = np.empty(4, np.int64)
    for block in range((columns + BLOCK - 1) // BLOCK):
        first, last = block * BLOCK, min(columns, (block + 1) * BLOCK)
        _ground(
            first, last, column_cos, column_sin, ring_cos, ring_sin, origins, rotations, max_m, ranges, hits, cosines
        )
        for k in range(len(rects)):
            place[0], place[1], place[2] = rects[k, 0], rects[k, 1], 0.0
            shape[:] = 0.0
            shape[0, 0] = shape[1, 1] = rects[k, 2]
            shape[1, 0], shape[0, 1], shape[2, 2] = rects[k, 3], -rects[k, 3], 1.0
            flat = np.array([rects[k, 4], rects[k, 5], 1e-6])
            if _window(first, last, azimuths, elevations, origins, rotations, place, shape, flat, max_m, window):
                _rect(
                    window,
                    column_cos,
                    column_sin,
                    ring_cos,
                    ring_sin,
                    origins,
                    rotations,
                    max_m,
                    rects[k],
                    ranges,
                    hits,
                    cosines,
                )
        for i in range(len(kind)):
            if mover[i] < 0:
                place[:], shape[:] = centre[i], turned[i]
            else:
                _carried(
                    centre[i], turned[i], mover_position[block, mover[i]], mover_rotation[block, mover[i]], place, shape
                )
            if not _window(first, last, azimuths, elevations, origins, rotations, place, shape, half[i], max_m, window):
                continue
            for c in range(window[0], window[1]):
                _solid(
                    c,
                    window[2],
                    window[3],
                    kind[i],
                    FIRST_SOLID + i,
                    column_cos[c],
                    column_sin[c],
                    ring_cos,
                    ring_sin,
                    origins[c],
                    rotations[c],
                    place,
                    shape,
                    half[i],
                    max_m,
                    ranges,
                    hits,
                    cosines,
                )


@numba.njit(cache=True, error_model="numpy")
def _ground(
    first: int,
    last: int,
    column_cos: F64,
    column_sin: F64,
    ring_cos: F64,
    ring_sin: F64,
    origins: F64,
    rotations: F64,
    max_m: float,
    ranges: F32,
    hits: I16,
    cosines: F32,
) -> None:
    for c in range(first, last):
        level = rotations[c, 2, 0] * column_cos[c] + rotations[c, 2, 1] * column_sin[c]
        up, height = rotations[c, 2, 2], origins[c, 2]
        for r in range(len(ring_cos)):
            fall = -(ring_cos[r] * level + ring_sin[r] * up)
            far = height / fall if fall > _TINY else np.inf
            met = far <= max_m
            ranges[c, r] = far if met else np.inf
            hits[c, r] = GROUND_HIT if met else NO_HIT
            cosines[c, r] = fall


@numba.njit(cache=True, error_model="numpy")
def _carried(centre: F64, turned: F64, position: F64, rotation: F64, place: F64, shape: F64) -> None:
    """Pose in map of a shape that a mover carries."""
    for i in range(3):
        place[i] = position[i]
        for j in range(3):
            place[i] += rotation[i, j] * centre[j]
            shape[i, j] = 0.0
            for k in range(3):
                shape[i, j] += rotation[i, k] * turned[k, j]


@numba.njit(cache=True, error_model="numpy")
def _window(
    first: int,
    last: int,
    azimuths: F64,
    elevations: F64,
    origins: F64,
    rotations: F64,
    place: F64,
    shape: F64,
    half: F64,
    max_m: float,
    window: I64,
) -> bool:
    """The columns and rings of a block that can meet a box (from, behind, from, behind); False if none."""
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
    pad = _PAD_RAD + turn + step_m / (nearest - step_m)
    if left - right > math.pi - 0.3 - 2.0 * pad:
        return True  # the sensor's axis goes through it, or nearly
    step = (azimuths[first] - azimuths[last - 1]) / max(1, last - 1 - first) if last - first > 1 else 1e-3
    offset = towards - azimuths[middle]
    offset -= 2.0 * math.pi * math.floor(offset / (2.0 * math.pi) + 0.5)
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


@numba.njit(cache=True, error_model="numpy")
def _motion(first: int, last: int, middle: int, origins: F64, rotations: F64) -> tuple[float, float]:
    """How far the sensor goes (m) and turns (rad) between the middle of a block and its ends, at most."""
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


@numba.njit(cache=True, error_model="numpy")
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


@numba.njit(cache=True, error_model="numpy")
def _solid(
    c: int,
    ring_from: int,
    ring_to: int,
    kind: int,
    number: int,
    cos_a: float,
    sin_a: float,
    ring_cos: F64,
    ring_sin: F64,
    origin: F64,
    rotation: F64,
    place: F64,
    shape: F64,
    half: F64,
    max_m: float,
    ranges: F32,
    hits: I16,
    cosines: F32,
) -> None:
    """One column of beams against one solid, in its own frame: direction = cos(elevation) u + sin(elevation) w."""
    ox = oy = oz = ux = uy = uz = wx = wy = wz = 0.0
    for i in range(3):
        away = origin[i] - place[i]
        u = rotation[i, 0] * cos_a + rotation[i, 1] * sin_a
        w = rotation[i, 2]
        ox += shape[i, 0] * away
        oy += shape[i, 1] * away
        oz += shape[i, 2] * away
        ux += shape[i, 0] * u
        uy += shape[i, 1] * u
        uz += shape[i, 2] * u
        wx += shape[i, 0] * w
        wy += shape[i, 1] * w
        wz += shape[i, 2] * w
    for r in range(ring_from, ring_to):
        dx = ring_cos[r] * ux + ring_sin[r] * wx
        dy = ring_cos[r] * uy + ring_sin[r] * wy
        dz = ring_cos[r] * uz + ring_sin[r] * wz
        if kind == BOX:
            far, cosine = _enter_box(ox, oy, oz, dx, dy, dz, half[0], half[1], half[2])
        else:
            far, cosine = _enter_cylinder(ox, oy, oz, dx, dy, dz, half[0], half[2])
        if far < ranges[c, r] and far <= max_m:
            ranges[c, r] = far
            hits[c, r] = number
            cosines[c, r] = cosine


@numba.njit(cache=True, error_model="numpy", inline="always")
def _safe(value: float) -> float:
    return value if abs(value) > _TINY else _TINY


@numba.njit(cache=True, error_model="numpy", inline="always")
def _enter_box(
    ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, hx: float, hy: float, hz: float
) -> tuple[float, float]:
    """Where a ray enters a box, and the cosine to the face's normal; inf if it misses or begins inside."""
    ix, iy, iz = 1.0 / _safe(dx), 1.0 / _safe(dy), 1.0 / _safe(dz)
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


@numba.njit(cache=True, error_model="numpy", inline="always")
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


@numba.njit(cache=True, error_model="numpy")
def _rect(
    window: I64,
    column_cos: F64,
    column_sin: F64,
    ring_cos: F64,
    ring_sin: F64,
    origins: F64,
    rotations: F64,
    max_m: float,
    rect: F64,
    ranges: F32,
    hits: I16,
    cosines: F32,
) -> None:
    """Beams that met the ground inside a rectangle: it is wet there, or they fall on into the pit."""
    cx, cy, cos_y, sin_y, half_x, half_y, depth = rect[0], rect[1], rect[2], rect[3], rect[4], rect[5], rect[6]
    for c in range(window[0], window[1]):
        away_x, away_y = origins[c, 0] - cx, origins[c, 1] - cy
        ox, oy = cos_y * away_x + sin_y * away_y, cos_y * away_y - sin_y * away_x
        ux = rotations[c, 0, 0] * column_cos[c] + rotations[c, 0, 1] * column_sin[c]
        uy = rotations[c, 1, 0] * column_cos[c] + rotations[c, 1, 1] * column_sin[c]
        for r in range(window[2], window[3]):
            if hits[c, r] != GROUND_HIT:
                continue
            mx = ring_cos[r] * ux + ring_sin[r] * rotations[c, 0, 2]
            my = ring_cos[r] * uy + ring_sin[r] * rotations[c, 1, 2]
            dx, dy = _safe(cos_y * mx + sin_y * my), _safe(cos_y * my - sin_y * mx)
            far, fall = ranges[c, r], cosines[c, r]
            if abs(ox + far * dx) > half_x or abs(oy + far * dy) > half_y:
                continue
            if depth <= 0.0:
                hits[c, r] = WET_HIT
                continue
            side_x = (math.copysign(half_x, dx) - ox) / dx
            side_y = (math.copysign(half_y, dy) - oy) / dy
            floor = (origins[c, 2] + depth) / fall
            far = min(side_x, side_y, floor)
            cosine = fall if far == floor else abs(dx) if far == side_x else abs(dy)
            met = far <= max_m
            ranges[c, r] = far if met else np.inf
            hits[c, r] = PIT_HIT if met else NO_HIT
            cosines[c, r] = cosine
