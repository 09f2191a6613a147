"""Compiles what the benches' own surroundings run through, or loads it."""

from __future__ import annotations

import numpy as np

from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import load_robot
from sim.bench.navigation_course import Sensor, course


def warm_up() -> None:
    """One look around a course."""
    Sensor(course(1, load_robot().footprint), np.random.default_rng(0)).costmap(Pose2(2.0, 2.0, 0.0))
