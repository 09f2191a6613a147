"""Distances of a grid's cells to the nearest occupied one."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

NOTHING_OCCUPIED = np.float32(1e18)  # its square is finite


def distance_field(occupied: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(rows, columns) cells, from middle to middle, exact; 1e18 if no cell is occupied.

    OpenCV's is used because it is three to five times as fast as scipy's. The last bits of its result depend on the
    number of its threads; squared distances are whole numbers, so that rounding them removes the difference.
    """
    free = np.logical_not(occupied).view(np.uint8)
    cells = np.asarray(cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE), np.float32)
    np.minimum(cells, NOTHING_OCCUPIED, out=cells)
    np.multiply(cells, cells, out=cells)
    np.rint(cells, out=cells)
    return np.sqrt(cells, out=cells)


def clearance_field(occupied: NDArray[np.bool_], resolution_m: float, most_m: float) -> NDArray[np.float32]:
    """(rows, columns) metres to the nearest occupied cell, at most ``most_m``."""
    metres = distance_field(occupied) * np.float32(resolution_m)
    return metres.clip(max=np.float32(most_m))
