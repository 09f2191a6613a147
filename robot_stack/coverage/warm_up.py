"""Compiles the ray caster, or loads it."""

from __future__ import annotations

import numpy as np

from robot_stack.contract import frames
from robot_stack.core.robot import load_robot
from robot_stack.coverage.coverage import Body, View


def warm_up() -> None:
    """One cell without occlusion."""
    robot = load_robot()
    view = View(robot.range_sensors[frames.LIDAR], Body([], robot.footprint), edge_columns=1)
    view.count(np.ones((1, 2)), 0.2, 0.0, 0.6)
