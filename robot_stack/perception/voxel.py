"""Reduction of obstacle points: centroids of voxels."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.perception.cells import KERB, OBSTACLE

Float = NDArray[np.float32]
_EMPTY = -1
_OFFSET = 1 << 20  # voxel numbers are kept positive: +-50 km at 0.05 m


def voxels(xyz: Float, size_m: float, far_m: float = math.inf, far_size_m: float = 1.0) -> Float:
    """(m, 3) centroids of the points (n, 3) in each voxel of ``size_m``; in the order in which voxels appear.

    Beyond ``far_m`` from the origin in plan: of each upright column of ``far_size_m`` x ``far_size_m``.
    """
    slots = 1 << max(4, (4 * len(xyz)).bit_length() - 1)
    centroids = np.empty_like(xyz)
    sizes = (np.float32(size_m), np.float32(far_m), np.float32(far_size_m))
    count = _voxels(xyz, *sizes, slots, centroids)
    return centroids[:count]


def raised(xyz: Float, labels: NDArray[np.uint8]) -> Float:
    """(m, 3) the points (n, 3) that are obstacles or kerbs by their labels (n,)."""
    chosen = np.empty_like(xyz)
    return chosen[: _raised(xyz, labels, chosen)]


@compiled(inline="always")
def whole_below(value: Any) -> Any:
    """floor() as an int64: libm's floor for each coordinate took half of the time."""
    number = np.int64(value)
    return number - np.int64(value < number)


@compiled
def _raised(xyz: Float, labels: NDArray[np.uint8], chosen: Float) -> int:
    count = 0
    for i in range(len(labels)):
        if labels[i] == OBSTACLE or labels[i] == KERB:
            chosen[count, 0], chosen[count, 1], chosen[count, 2] = xyz[i, 0], xyz[i, 1], xyz[i, 2]
            count += 1
    return count


@compiled
def _voxels(xyz: Float, size: Any, far: Any, far_size: Any, slots: int, centroids: Float) -> int:
    keys = np.full(slots, _EMPTY, np.int64)
    numbers = np.empty(slots, np.int32)
    counts = np.zeros(len(xyz), np.int32)
    near_per_m, far_per_m = np.float32(1.0) / size, np.float32(1.0) / far_size
    mask = slots - 1
    used = 0
    for i in range(len(xyz)):
        x, y = xyz[i, 0], xyz[i, 1]
        near = x * x + y * y <= far * far
        per_m = near_per_m if near else far_per_m
        a = whole_below(x * per_m) + _OFFSET
        b = whole_below(y * per_m) + _OFFSET
        c = whole_below(xyz[i, 2] * per_m) + _OFFSET if near else np.int64(0)  # no height has the number 0
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
