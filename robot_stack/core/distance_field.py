"""Distances of a grid's cells to the nearest occupied one."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def distance_field(occupied: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(rows, columns) cells, from middle to middle, exact; more than 1e18 if no cell is occupied.

    OpenCV's is used because it is three to five times as fast as scipy's.
    """
    free = np.logical_not(occupied).view(np.uint8)
    return np.asarray(cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE), np.float32)


def clearance_field(occupied: NDArray[np.bool_], resolution_m: float, most_m: float) -> NDArray[np.float32]:
    """(rows, columns) metres to the nearest occupied cell, at most ``most_m``."""
    metres = distance_field(occupied) * np.float32(resolution_m)
    return metres.clip(max=np.float32(most_m))
