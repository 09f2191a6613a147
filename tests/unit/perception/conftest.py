"""The pipeline with the project's own configuration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from robot_stack.core.config import load
from robot_stack.core.point_cloud import Points
from robot_stack.core.robot import Robot, load_robot
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline


@pytest.fixture(scope="session")
def robot() -> Robot:
    return load_robot()


@pytest.fixture(scope="session")
def params() -> PerceptionParams:
    return load(PerceptionParams, "perception_pipeline")


@pytest.fixture
def pipeline(robot: Robot, params: PerceptionParams) -> Pipeline:
    return Pipeline(robot, params)


@dataclass(frozen=True)
class Look:
    """free_m: (sectors,) around the sensor, the distance up to which ground was seen."""

    obstacles: np.ndarray
    broken: int
    free_m: np.ndarray


@pytest.fixture
def look(pipeline: Pipeline) -> Callable[[Points], Look]:
    """Runs the pipeline on a sweep of a robot at rest."""

    def scene(points: Points) -> Look:
        pipeline.forget()
        found = pipeline.scene(points, 0.0)
        return Look(found.obstacles, found.broken, pipeline.segment(pipeline.points(points, 0.0)[0]).profile.free_m)

    return scene


def inside(xyz: np.ndarray, x: tuple[float, float], y: tuple[float, float]) -> np.ndarray:
    """Returns the points within a rectangle in plan."""
    mask = (xyz[:, 0] >= x[0]) & (xyz[:, 0] <= x[1]) & (xyz[:, 1] >= y[0]) & (xyz[:, 1] <= y[1])
    return xyz[mask]
