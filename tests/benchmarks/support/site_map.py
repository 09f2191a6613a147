"""The cells for a bench's localization: the site's map if it exists, else one made from true poses."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.config import ConfigError, load
from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import load_robot
from robot_stack.core.site_map import Cells, load_map
from robot_stack.localization.ndt import cloud
from robot_stack.localization.ndt.matcher import pose_of
from robot_stack.localization.params import LocalizationParams
from robot_stack.mapping.cells import CellAccumulator
from sim.lidar.views import sweep_at
from sim.worldfile import WorldFile

Array = NDArray[np.float64]
_STEP_M, _VOXEL_M, _CELL_M, _MIN_POINTS = 1.5, 0.1, 1.0, 10
_ON_RAMP_M = 1.2


def site_cells(world: WorldFile, name: str, seed: int) -> tuple[Cells, str]:
    """The cells of the map ``name`` and a description of their origin."""
    try:
        site = load_map(name)
    except ConfigError:
        return cells_at_true_poses(world, seed), "made from sweeps at true poses along the routes, standing; no people"
    return site.cells, f"config/maps/{name}, from a recorded ride"


def cells_at_true_poses(world: WorldFile, seed: int) -> Cells:
    """Cells from poses every 1.5 m of every route, level ground only."""
    lidar, up = np.array(load_robot().lidar_xyz_m), np.array([0.0, 0.0, 1.0])
    params = load(LocalizationParams, "ndt_localization").ndt.cloud
    cells = CellAccumulator(_CELL_M)
    for index, pose in enumerate(level_poses(world, _STEP_M, 0.0)):
        base = pose_of(pose, 0.0, up)
        sweep, _ = sweep_at(world, base, seed=seed + index)
        points = cloud.subsample(sweep, lidar, np.zeros((1, 4)), _VOXEL_M, params.min_range_m, params.max_range_m)
        cells.add(points @ base[:3, :3].T + base[:3, 3])
    return cells.cells(_MIN_POINTS)


def level_poses(world: WorldFile, step_m: float, offset: float) -> list[Pose2]:
    """Poses every step_m along all routes, heading along them, but not on ramps. offset: fraction of a step, 0 to 1."""
    found = []
    for route in world.routes.values():
        points = np.array(route.points_m, float)
        for a, b in itertools.pairwise(points):
            yaw, count = math.atan2(*(b - a)[::-1]), max(1, int(np.hypot(*(b - a)) / step_m))
            for k in range(count):
                x, y = a + (b - a) * (k + offset) / count
                if not _on_ramp(x, y, world):
                    found.append(Pose2(float(x), float(y), yaw))
    return found


def _on_ramp(x: float, y: float, world: WorldFile) -> bool:
    for ramp in world.ramps:
        c, s = math.cos(ramp.yaw_rad), math.sin(ramp.yaw_rad)
        along, across = c * (x - ramp.x_m) + s * (y - ramp.y_m), -s * (x - ramp.x_m) + c * (y - ramp.y_m)
        if -_ON_RAMP_M < along < ramp.total_length_m + _ON_RAMP_M and abs(across) < 0.5 * ramp.width_m + _ON_RAMP_M:
            return True
    return False
