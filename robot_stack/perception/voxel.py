"""Obstacle points made few: stray points removed, the others gathered in voxels."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float32]
_EMPTY = -1
_OFFSET = 1 << 20  # voxel numbers are kept positive: +-50 km at 0.05 m


def without_strays(xyz: Float, range_m: float, size_m: float, neighbours_min: int) -> Float:
    """The points (n, 3) within ``range_m`` of the origin in plan that are not alone.

    A point stays if its column of size_m x size_m and the eight around it hold ``neighbours_min`` points, itself
    included, at whatever height: a pole or a leg is thin, but high.
    """
    side = 2 * math.ceil(range_m / size_m) + 3
    kept = np.empty_like(xyz)
    count = _without_strays(xyz, np.float32(range_m), np.float32(size_m), neighbours_min, side, kept)
    return kept[:count]


def voxels(xyz: Float, size_m: float) -> Float:
    """(m, 3) centroids of the points (n, 3) in each voxel of ``size_m``; in the order in which voxels appear."""
    slots = 1 << max(4, (4 * len(xyz)).bit_length() - 1)
    centroids = np.empty_like(xyz)
    count = _voxels(xyz, np.float32(size_m), slots, centroids)
    return centroids[:count]


@numba.njit(cache=True)
def _without_strays(xyz: Float, reach: Any, size: Any, least: int, side: int, kept: Float) -> int:
    counts = np.zeros((side, side), np.uint16)
    middle = side // 2
    per_m = np.float32(1.0) / size
    for i in range(len(xyz)):
        x, y = xyz[i, 0], xyz[i, 1]
        if x * x + y * y <= reach * reach:
            column, row = math.floor(x * per_m) + middle, math.floor(y * per_m) + middle
            if counts[column, row] < 60000:
                counts[column, row] += 1
    kept_count = 0
    for i in range(len(xyz)):
        x, y = xyz[i, 0], xyz[i, 1]
        if not x * x + y * y <= reach * reach:
            continue
        column, row = math.floor(x * per_m) + middle, math.floor(y * per_m) + middle
        total = 0
        for a in range(column - 1, column + 2):
            for b in range(row - 1, row + 2):
                total += counts[a, b]
        if total >= least:
            for axis in range(3):
                kept[kept_count, axis] = xyz[i, axis]
            kept_count += 1
    return kept_count


@numba.njit(cache=True)
def _voxels(xyz: Float, size: Any, slots: int, centroids: Float) -> int:
    keys = np.full(slots, _EMPTY, np.int64)
    numbers = np.empty(slots, np.int32)
    counts = np.zeros(len(xyz), np.int32)
    per_m = np.float32(1.0) / size
    mask = slots - 1
    used = 0
    for i in range(len(xyz)):
        a = np.int64(math.floor(xyz[i, 0] * per_m)) + _OFFSET
        b = np.int64(math.floor(xyz[i, 1] * per_m)) + _OFFSET
        c = np.int64(math.floor(xyz[i, 2] * per_m)) + _OFFSET
        key = (a << 42) | (b << 21) | c
        slot = ((a * 73856093) ^ (b * 19349663) ^ (c * 83492791)) & mask
        while keys[slot] != _EMPTY and keys[slot] != key:
            slot = (slot + 1) & mask
        if keys[slot] == _EMPTY:
            keys[slot], numbers[slot] = key, used
            for axis in range(3):
                centroids[used, axis] = np.float32(0.0)
            used += 1
        number = numbers[slot]
        counts[number] += 1
        for axis in range(3):
            centroids[number, axis] += xyz[i, axis]
    for number in range(used):
        for axis in range(3):
            centroids[number, axis] /= np.float32(counts[number])
    return used
