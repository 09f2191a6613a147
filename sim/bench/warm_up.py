"""Compiles the benches' own numba functions, or loads them from the cache."""

from __future__ import annotations

import numpy as np

from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import load_robot
from sim.bench.navigation_course import Sensor, course


def warm_up() -> None:
    """Computes one costmap of a course."""
    Sensor(course(1, load_robot().footprint), np.random.default_rng(0)).costmap(Pose2(2.0, 2.0, 0.0))
