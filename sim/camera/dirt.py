"""Dirt on the markers, for the kernel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@compiled
def soiled(u: float, v: float, value: float, grids: F64, n: int, dirt: F32, dirt_reflectance: float) -> float:
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
            return float(value + (upper * (1.0 - b) + lower * b) * (dirt_reflectance - value))
    return value
