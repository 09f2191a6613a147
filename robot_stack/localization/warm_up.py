"""Compiles or loads the kernels of matching before the first sweep instead of during it."""

from __future__ import annotations

import numpy as np

from robot_stack.core.point_cloud import SWEEP
from robot_stack.core.site_map import Cells
from robot_stack.localization.ndt import cloud, kernels, scoring
from robot_stack.localization.ndt.field import field_of


def warm_up() -> None:
    """A match against four cells."""
    key = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.int32)
    spread = np.tile(0.01 * np.eye(3), (4, 1, 1))
    middle = key.astype(np.float64) + 0.5
    field = field_of(Cells(1.0, key, middle, spread, np.full(4, 100)), 3)
    sweep = np.zeros(2, SWEEP)
    sweep["x"] = 5.0
    cloud.subsample(sweep, np.zeros(3), np.zeros((1, 4)), 0.5, 1.0, 50.0)
    points, rotation, position, information = middle, np.eye(3), np.zeros(3), np.empty((6, 6))
    prior, limits = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 1.0]), np.array([2.0, 0.1, 0.1, 1e-3, 1e-3])
    kernels.newton(points, rotation, position, field, -1.0, 1.0, prior, limits)
    scoring.judge(points, rotation, position, field, 0.4, 9.0, information)
    scoring.shares(points, rotation[None], position[None], field, 9.0, np.empty(1))
    scoring.pierced(points, rotation, position, position, field, 0.4, 1.5, 4.0)
    scoring.correlate(points, field, np.zeros((1, 3)), np.zeros(1), np.empty((1, 1)))
