"""The footprint in force as points along its edge."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from robot_stack.core.robot import Footprint

Array = npt.NDArray[np.float64]
# A person's leg, the narrowest relevant obstacle, must not fit between two points.
_SPACING_M = 0.12


def outline(footprint: Footprint) -> Array:
    """(n, 2) points along the edge, base_link, m, corners included. Read-only."""
    return _outline(footprint.front_m, footprint.rear_m, footprint.width_m)


@lru_cache(maxsize=8)
def _outline(front_m: float, rear_m: float, width_m: float) -> Array:
    half = 0.5 * width_m
    corners = np.array([(front_m, -half), (front_m, half), (rear_m, half), (rear_m, -half)])
    edges = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = math.ceil(float(np.hypot(*(b - a))) / _SPACING_M)
        edges.append(a + (b - a) * np.arange(count)[:, None] / count)
    points = np.concatenate(edges)
    points.setflags(write=False)
    return points


def box_of(footprint: Footprint) -> Array:
    """front, rear, half width, middle: (4,) m."""
    middle = 0.5 * (footprint.front_m + footprint.rear_m)
    return np.array([footprint.front_m, footprint.rear_m, 0.5 * footprint.width_m, middle])
