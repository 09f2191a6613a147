"""Compiles or loads the kernels of map building."""

from __future__ import annotations

import numpy as np

from robot_stack.core.config import load
from robot_stack.mapping.cells import cells_of
from robot_stack.mapping.ground import bins_of, surface_of
from robot_stack.mapping.moving_objects import votes_of
from robot_stack.mapping.params import MappingParams
from robot_stack.mapping.registration import align, target_of


def warm_up() -> None:
    """A few steps over a patch of ground."""
    params, poses = load(MappingParams, "mapping"), np.tile(np.eye(4), (2, 1, 1))
    x, y = (axis.ravel() for axis in np.mgrid[0.0:2.0:0.05, 0.0:2.0:0.05])
    points = np.column_stack((x, y, 0.01 * np.sin(7.0 * x + 5.0 * y)))
    targets = [target_of(cells_of(points, 0.5, 5))]
    for laid in (points, points[::2]):
        align(laid, targets, poses[0], most_iterations=1)
    votes_of([points, points], poses, np.ones(3), params.moving_objects, lambda: None)
    surface_of(bins_of([points, points], params.grid.resolution_m), poses[:, :3, 3], params.grid)
