"""Compiles what a sweep of the simulated LiDAR runs through, or loads it."""

from __future__ import annotations

import numpy as np

from robot_stack.core.robot import load_robot
from sim.camera.motion import still
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import WHEELCHAIR, build_scene
from sim.lidar.sensor import Conditions, Lidar
from sim.lidar.weather import Weather
from sim.parameters import load_sim_params
from sim.worldfile import load_world

_WET_WORLD = "yard"  # its puddle mirrors
_COLUMNS = 8


def warm_up() -> None:
    """One coarse sweep of wet ground, in the rain."""
    params = load_lidar_params().with_columns(_COLUMNS)
    scene = build_scene(load_world(_WET_WORLD), params, load_sim_params().wheelchair)
    place = still(np.eye(4))
    sensor, conditions = Lidar(scene, params, load_robot(), seed=0), Conditions(weather=Weather("rain", 25.0))
    sensor.sweep(place, 0.0, {WHEELCHAIR: place}, conditions)
