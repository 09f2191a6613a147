"""A ramp too steep to climb is still ground: the slope limit stops the robot on it, not an obstacle in front of it."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.contract.frames import OVERHEAD_LIDAR
from robot_stack.core.geometry import Twist2
from robot_stack.core.robot_shape import load_robot_shape
from sim.lidar.bodies import robot_shapes
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import build_scene
from sim.lidar.sensor import Lidar
from sim.params import load_sim_params
from sim.worldfile import load_world
from tests.unit.space.yard import ROBOT, Yard

FOOT_M, ASIDE_M = 1.5, 0.5  # of config/worlds/steep_ramp.yaml
REACHED_M = 1.0  # of base_link: the front is at the foot


@pytest.mark.parametrize(("columns", "seed"), [(400, 1), (800, 3)])
def test_steep_ramp_yields_no_obstacle_at_its_foot(columns: int, seed: int) -> None:
    """A remembered obstacle would stop the robot in front of it. Far up, single cells may appear as steps."""
    world, chair = load_world("steep_ramp"), load_sim_params().wheelchair
    params, above = load_lidar_params().with_columns(columns), load_lidar_params(OVERHEAD_LIDAR)
    own = robot_shapes(ROBOT, load_robot_shape())
    yard = Yard()
    yard._lidar = Lidar(build_scene(world, params, chair), params, ROBOT, seed)
    yard._overhead = Lidar(build_scene(world, above, chair, own=own), above, ROBOT, seed + 1, OVERHEAD_LIDAR)
    yard.twist = Twist2(0.5, 0.0, 0.0)
    while yard.pose.x < REACHED_M:
        found = yard.step().obstacles
        ahead = found[np.abs(found[:, 1]) < ASIDE_M, 0] + yard.pose.x
        assert not (ahead < FOOT_M + 1.2).any(), yard.pose
