"""The compiled ray caster: beams against the robot's own solids, and against objects around it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.core.robot_shape import Placed

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
_KINDS = {"box": 0, "cylinder": 1, "sphere": 2}
_TINY = 1e-12


class PackedSolids:
    """Solids as arrays for the ray caster, to cast from many origins."""

    def __init__(self, solids: Sequence[Placed]) -> None:
        self._kinds = np.array([_KINDS[item.solid.kind] for item in solids], np.int64)
        self._half = np.array([item.solid.size_m for item in solids], float).reshape(-1, 3) * 0.5
        self._inverse = np.array([np.linalg.inv(item.pose)[:3] for item in solids], float).reshape(-1, 3, 4)

    def ranges(self, origin: F64, beams: F64) -> F64:
        """(n,) range at which each beam first hits one of the solids, m; inf: none.

        origin: (3,) m, beams: (n, 3) unit vectors, contiguous, in the solids' frame. A solid around the origin is the
        sensor's housing and occludes nothing.
        """
        ranges = np.full(len(beams), np.inf)
        _meet_solids(origin, beams, self._kinds, self._half, self._inverse, ranges)
        return ranges


def own_ranges(origin: F64, beams: F64, solids: Sequence[Placed]) -> F64:
    """As ``PackedSolids.ranges``."""
    return PackedSolids(solids).ranges(np.asarray(origin, float), np.ascontiguousarray(beams))


@compiled(error_model="numpy")
def _meet_solids(origin: F64, beams: F64, kinds: I64, half: F64, inverse: F64, ranges: F64) -> None:
    o, d = np.empty(3), np.empty(3)
    for k in range(len(kinds)):
        m = inverse[k]
        for i in range(3):
            o[i] = m[i, 0] * origin[0] + m[i, 1] * origin[1] + m[i, 2] * origin[2] + m[i, 3]
        for n in range(len(beams)):
            for i in range(3):
                d[i] = m[i, 0] * beams[n, 0] + m[i, 1] * beams[n, 1] + m[i, 2] * beams[n, 2]
            if kinds[k] == 0:
                far = _enter_box(o, d, half[k])
            elif kinds[k] == 1:
                far = enter_cylinder(o[0], o[1], o[2], d[0], d[1], d[2], half[k, 0], -half[k, 2], half[k, 2])
            else:
                far = _enter_ball(o, d, half[k])
            if far < ranges[n]:
                ranges[n] = far


@compiled(error_model="numpy")
def _enter_box(o: F64, d: F64, half: F64) -> float:
    near, far = -np.inf, np.inf
    for i in range(3):
        step = d[i] if abs(d[i]) > _TINY else _TINY
        one, other = (-half[i] - o[i]) / step, (half[i] - o[i]) / step
        near, far = max(near, min(one, other)), min(far, max(one, other))
    return near if 0.0 < near <= far else np.inf


@compiled(error_model="numpy")
def _enter_ball(o: F64, d: F64, half: F64) -> float:
    """An ellipsoid by its half axes."""
    a, b, c = 0.0, 0.0, -1.0
    for i in range(3):
        a += (d[i] / half[i]) ** 2
        b += o[i] * d[i] / half[i] ** 2
        c += (o[i] / half[i]) ** 2
    root = b * b - a * c
    if c <= 0.0 or b >= 0.0 or root <= 0.0:
        return np.inf
    return (-b - math.sqrt(root)) / a


@compiled(error_model="numpy", inline="always")
def enter_cylinder(
    ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, radius: float, foot: float, top: float
) -> float:
    """Distance to an upright cylinder about the z axis from foot to top; inf if the ray misses or begins inside."""
    a, b, c = dx * dx + dy * dy, ox * dx + oy * dy, ox * ox + oy * oy - radius * radius
    if c > 0.0:  # from beside it: through the side
        root = b * b - a * c
        if root <= 0.0 or b >= 0.0:
            return np.inf
        near = (-b - math.sqrt(root)) / a
        z = oz + near * dz
        if foot <= z <= top:
            return near
        edge = foot if z < foot else top
    else:
        if foot <= oz <= top:
            return np.inf
        edge = foot if oz < foot else top
    if (edge - oz) * dz <= 0.0:
        return np.inf
    near = (edge - oz) / dz
    x, y = ox + near * dx, oy + near * dy
    return near if x * x + y * y <= radius * radius else np.inf


@compiled(error_model="numpy")
def count_on_things(
    origin: F64,
    beams: F64,
    reach: F64,
    azimuths: F64,
    least_m: float,
    cells: F64,
    radius: float,
    foot: float,
    top: float,
    counts: I64,
) -> None:
    """Adds to ``counts`` (m,) the number of beams that hit an upright cylinder at each of the cells (m, 2), m.

    beams: (n, 3) in the order of rising azimuths (n,), rad; reach: (n,) largest range of each, m; least_m: the
    sensor's smallest range.
    """
    for m in range(len(cells)):
        x, y = cells[m, 0] - origin[0], cells[m, 1] - origin[1]
        away = math.sqrt(x * x + y * y)
        if away <= radius * 1.001:
            counts[m] += _count(0, len(beams), beams, reach, least_m, -x, -y, origin[2], radius, foot, top)
            continue
        towards, width = math.atan2(y, x), math.asin(radius / away) + 1e-9
        for turn in (-2.0 * math.pi, 0.0, 2.0 * math.pi):
            first = int(np.searchsorted(azimuths, towards - width + turn))
            last = int(np.searchsorted(azimuths, towards + width + turn))
            counts[m] += _count(first, last, beams, reach, least_m, -x, -y, origin[2], radius, foot, top)


@compiled(error_model="numpy")
def _count(
    first: int,
    last: int,
    beams: F64,
    reach: F64,
    least_m: float,
    ox: float,
    oy: float,
    oz: float,
    radius: float,
    foot: float,
    top: float,
) -> int:
    found = 0
    for n in range(first, last):
        far = enter_cylinder(ox, oy, oz, beams[n, 0], beams[n, 1], beams[n, 2], radius, foot, top)
        if least_m <= far <= reach[n]:
            found += 1
    return found
