"""Compiles the kernels of the simulated LiDAR, or loads them."""

from __future__ import annotations

import numpy as np

from robot_stack.core.robot import load_robot
from sim.camera.motion import still
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import WHEELCHAIR, build_scene
from sim.lidar.sensor import Conditions, Lidar
from sim.lidar.weather import Weather
from sim.params import load_sim_params
from sim.worldfile import load_world

_WET_WORLD = "yard"  # its puddle mirrors
_COLUMNS = 8


def warm_up() -> None:
    """A coarse sweep of wet ground, in the rain, and one between walls of glass."""
    params, world = load_lidar_params().with_columns(_COLUMNS), load_world(_WET_WORLD)
    of_glass = world.model_copy(update={"glass": [wall.name for wall in world.walls]})
    place, conditions = still(np.eye(4)), Conditions(weather=Weather("rain", 25.0))
    for each in (world, of_glass):
        scene = build_scene(each, params, load_sim_params().wheelchair)
        Lidar(scene, params, load_robot(), seed=0).sweep(place, 0.0, {WHEELCHAIR: place}, conditions)
