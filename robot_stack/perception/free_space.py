"""How far the ground was seen free, in every direction of base_link."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from robot_stack.perception.polar import angle_of

Float = NDArray[np.float32]
_PI = math.pi


def free_ranges(free_m: Float, sensor_xy_m: tuple[float, float], obstacles: Float, directions: int) -> Float:
    """(directions,) range of free ground around base_link, m, 0 where none was seen.

    Direction i is -pi + (i + 0.5) * 2 pi / directions. free_m: (sectors,) free distance around the sensor, as the
    ground's profile gives it; sensor_xy_m: the sensor in base_link. obstacles: (n, 3) base_link; the nearest one of a
    direction ends it.
    """
    ranges = np.full(directions, np.inf, np.float32)
    x0, y0 = np.float32(sensor_xy_m[0]), np.float32(sensor_xy_m[1])
    _spread(free_m, x0, y0, ranges)
    _close_seams(free_m, x0, y0, ranges)
    ranges[~np.isfinite(ranges)] = 0.0
    _cut(obstacles, ranges)
    return ranges


@numba.njit(cache=True)
def _spread(free: Float, x0: Any, y0: Any, ranges: Float) -> None:
    sectors, directions = len(free), len(ranges)
    width = 2.0 * _PI / sectors
    for s in range(sectors):
        if free[s] <= np.float32(0.0):
            continue
        # Both ends of the sector's outer border, as seen from base_link: the nearer one counts for all between them.
        first, last, nearest = 0, 0, np.inf
        for end in range(2):
            angle = (s + end) * width - _PI
            x, y = x0 + free[s] * math.cos(angle), y0 + free[s] * math.sin(angle)
            index = math.floor((math.atan2(y, x) + _PI) / (2.0 * _PI) * directions + 1e-3)
            nearest = min(nearest, math.sqrt(x * x + y * y))
            if end == 0:
                first = index
            else:
                last = index
        span = (last - first) % directions
        if span > directions // 2:
            continue
        for step in range(max(span, 1)):
            i = (first + step) % directions
            ranges[i] = min(ranges[i], np.float32(nearest))


@numba.njit(cache=True)
def _close_seams(free: Float, x0: Any, y0: Any, ranges: Float) -> None:
    """Neighbours of unlike length meet at two angles, as seen from base_link: between these the shorter one counts."""
    sectors, directions = len(free), len(ranges)
    width = 2.0 * _PI / sectors
    for s in range(sectors):
        other = (s + 1) % sectors
        if free[s] <= np.float32(0.0) or free[other] <= np.float32(0.0):
            continue
        angle = (s + 1) * width - _PI
        shorter = min(free[s], free[other])
        x, y = x0 + shorter * math.cos(angle), y0 + shorter * math.sin(angle)
        away, near = math.sqrt(x * x + y * y), math.atan2(y, x)
        longer = max(free[s], free[other])
        far = math.atan2(y0 + longer * math.sin(angle), x0 + longer * math.cos(angle))
        turn = (far - near + _PI) % (2.0 * _PI) - _PI
        begin = near if turn >= 0.0 else far
        first = math.floor((begin + _PI) / (2.0 * _PI) * directions)
        last = math.floor((begin + abs(turn) + _PI) / (2.0 * _PI) * directions)
        for i in range(first, last + 1):
            ranges[i % directions] = min(ranges[i % directions], np.float32(away))


@numba.njit(cache=True)
def _cut(obstacles: Float, ranges: Float) -> None:
    directions = len(ranges)
    per_rad = np.float32(directions / (2.0 * _PI))
    for k in range(len(obstacles)):
        x, y = obstacles[k, 0], obstacles[k, 1]
        i = min(int((angle_of(y, x) + np.float32(_PI)) * per_rad), directions - 1)
        ranges[i] = min(ranges[i], np.float32(math.sqrt(x * x + y * y)))
