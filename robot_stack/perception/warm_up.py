"""Compiles or loads the kernels of a sweep before the first one instead of during it."""

from __future__ import annotations

import numpy as np

from robot_stack.core.config import load
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST
from robot_stack.core.point_cloud import SWEEP
from robot_stack.core.robot import load_robot
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline
from robot_stack.perception.space.view import view_of_beams
from robot_stack.perception.watch import Watch

_COLUMNS = 360


def warm_up() -> None:
    """Two sweeps of flat ground around a standing robot, by both LiDARs: one of them is mounted rotated."""
    params = load(PerceptionParams, "perception_pipeline")
    points = np.zeros(_COLUMNS, SWEEP)
    angles = np.linspace(-np.pi, np.pi, _COLUMNS)
    points["x"], points["y"] = 2.0 * np.cos(angles), 2.0 * np.sin(angles)
    points["time"] = np.linspace(-0.05, 0.0, _COLUMNS)
    robot = load_robot()
    Watch(params.watch, robot.lidar_xyz_m[2]).blind(points, 0.0)
    pipeline = Pipeline(robot, params)
    for stamp_s in (0.0, 0.05):
        pipeline.motion.on_odometry(stamp_s, IDENTITY, ZERO_TWIST)
        pipeline.overhead(points, stamp_s)
        pipeline.scene(points, stamp_s)
        pipeline.chair = True
    ends = np.zeros((1, 3), np.float32)
    pipeline.space.observe(
        view_of_beams(0.1, (0.0, 0.0, 0.2), ends, np.ones(1, np.bool_), ends[:, 0] > 1.0, 1.0), IDENTITY
    )
    pipeline.space.mark_hidden_body(np.zeros((1, 3)), 0.1, 0.0, IDENTITY)
