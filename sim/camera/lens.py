"""Disturbances of the lens: sun glare and rain drops."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.camera.conditions import Glare

F32 = NDArray[np.float32]
_SATURATED_DN = 255.0
_COARSE = 8
_MOST_DROPS = 45
_SMALLEST_PX, _LARGEST_PX = 9.0, 46.0
_SMALL_IMAGE = 4
_CHANGE = 0.01  # share of the drops that are replaced in the next picture


@lru_cache(maxsize=8)
def glare_map(size: tuple[int, int], glare: Glare) -> F32:
    """(height, width) grey levels that glare adds: a bloom that saturates within its radius, streaks, and a veil."""
    height, width = size
    rows, columns = np.mgrid[0 : height // _COARSE + 1, 0 : width // _COARSE + 1] * float(_COARSE)
    dy, dx = rows - glare.row_px, columns - glare.column_px
    radius = max(glare.radius_px, 1.0)
    distance = np.hypot(dx, dy) / radius
    # One at the radius; outside it falls like scattered light, which makes a bloom wider than its source.
    bloom = _SATURATED_DN / (1.0 + np.maximum(distance - 0.6, 0.0) ** 2 * 6.0)
    angle = np.arctan2(dy, dx)
    streaks = 40.0 * np.abs(np.cos(3.0 * angle)) ** 40 / (1.0 + distance)
    coarse = (bloom + streaks + glare.veil_dn).astype(np.float32) if glare.radius_px > 0.0 else None
    if coarse is None:
        return np.full(size, glare.veil_dn, np.float32)
    fine = cv2.resize(coarse, (coarse.shape[1] * _COARSE, coarse.shape[0] * _COARSE), interpolation=cv2.INTER_LINEAR)
    return np.ascontiguousarray(fine[:height, :width])


class Drops:
    """Drops on the lens. Each shows the scene small and upside down, blurred, as a thick lens out of focus does."""

    def __init__(self, size: tuple[int, int], random: np.random.Generator) -> None:
        self._size, self._random = size, random
        self._drops = np.stack([self._new_drop() for _ in range(_MOST_DROPS)])  # (n, 3): column, row, radius

    def refract(self, image: F32, share: float) -> None:
        """Draws the first ``share`` of the drops over the image, in place. A few drops run off at each call."""
        for index in np.flatnonzero(self._random.random(_MOST_DROPS) < _CHANGE):
            self._drops[index] = self._new_drop()
        count = int(np.ceil(share * _MOST_DROPS))
        height, width = self._size
        size = (width // _SMALL_IMAGE, height // _SMALL_IMAGE)
        small = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.float32)
        for column, row, radius in self._drops[:count]:
            _draw_drop(image, small, int(column), int(row), int(radius))

    def _new_drop(self) -> NDArray[np.float64]:
        height, width = self._size
        # Small drops are many, large ones few.
        radius = _SMALLEST_PX + (_LARGEST_PX - _SMALLEST_PX) * self._random.random() ** 3
        return np.array([self._random.uniform(0, width), self._random.uniform(0, height), radius])


def _draw_drop(image: F32, small: F32, column: int, row: int, radius: int) -> None:
    height, width = image.shape
    side = 2 * radius + 1
    # The drop shows a part of the picture four times its own size.
    half = max(2, radius)
    y, x = row // _SMALL_IMAGE, column // _SMALL_IMAGE
    part = small[max(y - half, 0) : y + half, max(x - half, 0) : x + half]
    if part.size == 0:
        return
    seen = cv2.GaussianBlur(cv2.resize(part[::-1, ::-1], (side, side)), (0, 0), 1.5)
    top, left = max(row - radius, 0), max(column - radius, 0)
    bottom, right = min(row + radius + 1, height), min(column + radius + 1, width)
    inner = (slice(top - row + radius, bottom - row + radius), slice(left - column + radius, right - column + radius))
    weight = _drop_shape(radius)[inner]
    target = image[top:bottom, left:right]
    target += weight * (1.08 * seen[inner] - target)


@lru_cache(maxsize=64)
def _drop_shape(radius: int) -> F32:
    """(2 r + 1, 2 r + 1) opacity: full inside, soft at the rim."""
    rows, columns = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    shape = np.clip(1.2 * (radius - np.hypot(rows, columns)) / (0.3 * radius + 1.0), 0.0, 1.0)
    return np.asarray(shape, dtype=np.float32)
