"""Poses of /sim/bodies as matrices."""

from __future__ import annotations

import math
from typing import Any

import numpy as np


def matrix_of_transform(transform: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(4, 4) of a Transform message; not finite where it is no rotation."""
    t, q = transform.translation, transform.rotation
    norm2 = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w
    # Written out: this runs for every body of every sample.
    scale = 2.0 / norm2 if norm2 > 0.5 else math.nan
    xx, yy, zz = scale * q.x * q.x, scale * q.y * q.y, scale * q.z * q.z
    xy, xz, yz = scale * q.x * q.y, scale * q.x * q.z, scale * q.y * q.z
    wx, wy, wz = scale * q.w * q.x, scale * q.w * q.y, scale * q.w * q.z
    return np.array(
        [
            [1.0 - yy - zz, xy - wz, xz + wy, t.x],
            [xy + wz, 1.0 - xx - zz, yz - wx, t.y],
            [xz - wy, yz + wx, 1.0 - xx - yy, t.z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
