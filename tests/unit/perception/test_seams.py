"""Half sweeps of a moving robot end in a seam, where a single column shows the ground after de-skew."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.core.geometry import Twist2, exp_se2
from robot_stack.core.robot import Robot
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import build_scene
from sim.lidar.sensor import Lidar
from sim.lidar.views import moving
from sim.parameters import load_sim_params
from sim.worldfile import load_world

PERIOD_S = 0.1
STAMP_S = 100.0


@pytest.mark.parametrize("columns", [400, 2344])
@pytest.mark.parametrize("twist", [Twist2(0.6, 0.2, 0.5), Twist2(0.0, 0.0, -0.7)])
def test_even_ground_has_no_obstacles_for_a_robot_that_turns(
    robot: Robot, params: PerceptionParams, twist: Twist2, columns: int
) -> None:
    beams = load_lidar_params().with_columns(columns)
    lidar = Lidar(build_scene(load_world("flat"), beams, load_sim_params().wheelchair), beams, robot, 1)
    false = 0
    for share in np.linspace(0.5, 1.5, 12):  # each turn rate places the seam differently in the cells
        turning = Twist2(*(float(share) * value for value in (twist.vx, twist.vy, twist.omega)))
        for half in (0, 1):
            pipeline = Pipeline(robot, params)
            for time_s in np.linspace(-PERIOD_S, 0.0, 11):
                pipeline.motion.on_odometry(STAMP_S + time_s, exp_se2(turning, float(time_s)), turning)
            points = lidar.half_sweep(moving(np.eye(4), turning, PERIOD_S), 0.0, half).points
            false += len(pipeline.scene(points, STAMP_S).obstacles)
    assert false == 0
