"""The seams at which half sweeps begin and end."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.contract import frames
from robot_stack.core.geometry import Pose2, Twist2, exp_se2
from robot_stack.core.point_cloud import SWEEP
from robot_stack.core.robot import Robot
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline
from robot_stack.perception.sensor_view import SensorView
from robot_stack.perception.space.view import View
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import build_scene
from sim.lidar.sensor import Lidar
from sim.lidar.views import moving
from sim.params import load_sim_params
from sim.worldfile import load_world

PERIOD_S = 0.1
STAMP_S = 100.0


@pytest.mark.parametrize(("twist", "columns"), [(Twist2(0.6, 0.2, 0.5), 400), (Twist2(0.0, 0.0, -0.7), 2344)])
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


def test_the_time_of_a_look_follows_from_its_direction(robot: Robot, params: PerceptionParams) -> None:
    """The first half of a turn goes from behind over the left side to the front; its stamp is its end."""
    turn = np.linspace(-np.pi, np.pi, 4001)[:-1]
    points = np.zeros(len(turn), SWEEP)
    points["x"], points["y"] = 5.0 * np.cos(turn), -5.0 * np.sin(turn)
    points["time"] = np.linspace(-PERIOD_S, 0.0, len(turn))
    points["x"][7] = np.nan
    origin, one = np.array(robot.lidar_xyz_m), np.zeros((1, 1), np.float32)
    sensor = SensorView(robot, params, frames.LIDAR, (0.3, 60.0))
    for part in (points[:2000], points):
        look = View(STAMP_S, robot.lidar_xyz_m, one, one, one, one > 0.0, looked_s=sensor.looked_s(part))
        for bearing_deg, after_s in ((178.0, 0.0), (90.0, 0.025), (2.0, 0.049)):
            bearing, pose = np.radians(bearing_deg), Pose2(1.0, 2.0, 0.5)
            place = pose.compose(Pose2(origin[0] + 4.0 * np.cos(bearing), origin[1] + 4.0 * np.sin(bearing), 0.0))
            assert look.seen_at_s(pose, place.x, place.y) - STAMP_S == pytest.approx(after_s - PERIOD_S, abs=0.002)
    assert not sensor.looked_s(points[:0]).any()
