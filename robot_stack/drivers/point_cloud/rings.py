"""Vendors number their lasers from the lowest or from the highest; the contract's ring 0 is the lowest."""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from robot_stack.drivers.point_cloud.cloud import CloudRefused

_SAMPLES = 8192
_SAMPLES_OF_A_RING = 3


class RingOrder(Enum):
    LOWEST_FIRST = "lowest first"
    HIGHEST_FIRST = "highest first"
    NONE = "none"  # lines that wander, as of a Livox


def ring_order(xyz: NDArray[np.float32], rings: NDArray[np.uint16]) -> RingOrder | None:
    """The order by the rings' mean elevations. None if fewer than two rings have enough points.

    xyz: (n, 3) m, sensor frame; rings: (n,).
    """
    step = max(1, len(xyz) // _SAMPLES)
    some, number = xyz[::step].astype(np.float64), rings[::step].astype(np.int64)
    rise = some[:, 2] / np.linalg.norm(some, axis=1)
    counts = np.bincount(number)
    means = np.bincount(number, weights=rise)[counts >= _SAMPLES_OF_A_RING] / counts[counts >= _SAMPLES_OF_A_RING]
    if len(means) < 2:
        return None
    steps = np.diff(means)
    if (steps > 0.0).all():
        return RingOrder.LOWEST_FIRST
    return RingOrder.HIGHEST_FIRST if (steps < 0.0).all() else RingOrder.NONE


def renumbered(rings: NDArray[np.uint16], order: RingOrder | None, count: int) -> NDArray[np.uint16]:
    """Rings from the lowest. count: the sensor's. Raises CloudRefused for a ring it does not have."""
    highest = int(rings.max(initial=0))
    if highest >= count:
        raise CloudRefused(f"a point is of ring {highest}, expected at most {count - 1} (config/robot.yaml)")
    if order is not RingOrder.HIGHEST_FIRST:
        return rings
    turned: NDArray[np.uint16] = np.uint16(count - 1) - rings
    return turned
