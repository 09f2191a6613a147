"""Windows of rows and columns in the picture around points in space."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.camera import Intrinsics
from sim.camera.model import project, undistort

Array = NDArray[np.float64]
NEAR_M = 0.02
_MARGIN_PX = 4.0
_ALONG_EDGE = np.linspace(0.0, 1.0, 5)


class View:
    """The field of view of a camera, in normalized coordinates."""

    def __init__(self, intrinsics: Intrinsics) -> None:
        self._intrinsics = intrinsics
        width, height = intrinsics.width, intrinsics.height
        columns, rows = np.linspace(-0.5, width - 0.5, 33), np.linspace(-0.5, height - 0.5, 33)
        rim = np.concatenate(
            [
                np.c_[columns, np.full(33, -0.5)],
                np.c_[columns, np.full(33, height - 0.5)],
                np.c_[np.full(33, -0.5), rows],
                np.c_[np.full(33, width - 0.5), rows],
            ]
        )
        rays = undistort(intrinsics, rim)
        self.low, self.high = rays.min(axis=0), rays.max(axis=0)

    def window(self, points: Array, edges: Array) -> NDArray[np.int64] | None:
        """First and last + 1 row and column that a convex body can touch; None if it is out of view.

        points: (n, 3) its corners in the optical frame, m. edges: (k, 2) pairs of them.
        """
        flat = flatten(points, edges)
        if flat is None:
            return None
        low, high = np.maximum(flat.min(axis=0), self.low), np.minimum(flat.max(axis=0), self.high)
        if (low >= high).any():
            return None
        x, y = low[0] + (high[0] - low[0]) * _ALONG_EDGE, low[1] + (high[1] - low[1]) * _ALONG_EDGE
        grid = np.stack([*np.meshgrid(x, y), np.ones((5, 5))], axis=-1).reshape(-1, 3)
        pixels = project(self._intrinsics, grid)
        size = np.array([self._intrinsics.width, self._intrinsics.height])
        first = np.clip(np.floor(pixels.min(axis=0) - _MARGIN_PX), 0, size).astype(np.int64)
        last = np.clip(np.ceil(pixels.max(axis=0) + _MARGIN_PX), 0, size).astype(np.int64)
        if (first >= last).any():
            return None
        return np.array([first[1], last[1], first[0], last[0]])


def flatten(points: Array, edges: Array) -> Array | None:
    """(k, 2) normalized coordinates of a convex body's corners, cut off before the camera; None if it is behind."""
    front = points[:, 2] > NEAR_M
    if front.all():
        return np.asarray(points[:, :2] / points[:, 2:])
    if not front.any():
        return None
    a, b = points[edges[:, 0]], points[edges[:, 1]]
    crossing = front[edges[:, 0]] != front[edges[:, 1]]
    a, b = a[crossing], b[crossing]
    part = (NEAR_M - a[:, 2:]) / (b[:, 2:] - a[:, 2:])
    cut = np.concatenate([points[front], a + part * (b - a)])
    return np.asarray(cut[:, :2] / cut[:, 2:])
