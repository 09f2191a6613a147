"""Small worlds and sensors shared by the tests of the LiDAR."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from robot_stack.core.config import validate
from robot_stack.core.robot import load_robot
from sim.lidar.params import LidarParams, load_lidar_params
from sim.lidar.scene import build_scene
from sim.lidar.sensor import Lidar
from sim.params import load_sim_params
from sim.worldfile import WorldFile

ROBOT, SIM = load_robot(), load_sim_params()
EMPTY: dict[str, Any] = {
    "note": "test",
    "friction": 0.8,
    "floor": {"min_x_m": -60, "max_x_m": 60, "min_y_m": -60, "max_y_m": 60},
    "start": {"x_m": 0, "y_m": 0, "yaw_deg": 0},
}
TRUE_RINGS = {"range_bias_m": 0.0, "elevation_bias_deg": 0.0}
# From base_link to the sensor's axis and up to its height.
AHEAD_M, UP_M = 0.20, 0.70


def world(**more: Any) -> WorldFile:
    return validate(WorldFile, {**EMPTY, **more}, "test")


@cache
def exact(columns: int = 360) -> LidarParams:
    """Returns parameters without noise, ring errors and losses, with the nominal mounting."""
    return changed(
        columns,
        ranging={"noise_m": 0.0, "lost_share": 0.0, "mixed_share": 0.0, "range_at_ten_percent_m": 1e6, **TRUE_RINGS},
        mounting={"position_m": 0.0, "rotation_rad": 0.0},
        wet={"lost_share": 0.0, "mirror_share": 0.0},
    )


def changed(columns: int = 360, **groups: dict[str, float]) -> LidarParams:
    data = load_lidar_params().model_dump()
    for group, values in groups.items():
        data[group] |= values
    return LidarParams.model_validate({**data, "beams": {**data["beams"], "columns": columns}})


def lidar(file: WorldFile, params: LidarParams, seed: int = 0, people: tuple[str, ...] = ()) -> Lidar:
    return Lidar(build_scene(file, params, SIM.wheelchair, people=people, passenger=False), params, ROBOT, seed)


def pose(x: float, y: float, yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0, z: float = 0.0) -> np.ndarray:
    """Returns a (4, 4) pose."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    matrix[:3, 3] = x, y, z
    return matrix
