"""A synthetic street and a sensor with ring errors: the road is free, objects on and beside it are found."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.core.robot import Robot
from robot_stack.perception.params import PerceptionParams
from tests.unit.perception import street
from tests.unit.perception.conftest import inside
from tests.unit.perception.scenes import Solid
from tests.unit.perception.test_ring_errors import made

BIASES = [(0.01, 0.025), (0.02, 0.05), (0.03, 0.05)]


def cloud(
    robot: Robot, params: PerceptionParams, bias: tuple[float, float], seed: int, aside_m: float = 0.0
) -> np.ndarray:
    """Returns the published cloud of one turn, with the ring errors specified in the configuration."""
    points = street.sweep(seed, bias, aside_m)
    found = made(robot, params, bias).scene(points, 0.0).obstacles
    return found[np.hypot(found[:, 0], found[:, 1]) < 8.0]


def away(xyz: np.ndarray, solid: Solid) -> np.ndarray:
    """Returns the (n,) distance of each point from a box, in plan."""
    out = [np.maximum(np.maximum(solid.low[i] - xyz[:, i], xyz[:, i] - solid.high[i]), 0.0) for i in (0, 1)]
    return np.asarray(np.hypot(*out))


@pytest.mark.parametrize("bias", BIASES)
@pytest.mark.parametrize("aside_m", [0.0, 1.2])
@pytest.mark.parametrize("seed", [11, 12, 13])
def test_the_plain_road_has_no_obstacles(
    robot: Robot, params: PerceptionParams, bias: tuple[float, float], aside_m: float, seed: int
) -> None:
    """Voxels on the road within 8 m, 0.3 m from kerbs and cars."""
    found = cloud(robot, params, bias, seed, aside_m)
    road = found[np.abs(found[:, 1] + aside_m) < street.HALF_ROAD_M - 0.3]
    beside = [away(road, street.moved(car, aside_m)) < 0.3 for car in street.CARS]
    assert (~np.logical_or.reduce(beside)).sum() == 0


@pytest.mark.parametrize("bias", BIASES)
@pytest.mark.parametrize("seed", [11, 12, 13])
def test_cars_poles_and_the_hedge_are_found(
    robot: Robot, params: PerceptionParams, bias: tuple[float, float], seed: int
) -> None:
    found = cloud(robot, params, bias, seed)
    left, right = street.CARS
    for car, face_m in ((left, left.low[1]), (right, right.high[1])):
        side = inside(found, (car.low[0], car.high[0]), (face_m - 0.15, face_m + 0.15))
        assert len(np.unique(np.floor(side[:, 0] / 0.2))) >= 18, "of 21 pieces of a side of 4.2 m"
    for pole in street.POLES:
        assert (away(found, pole) < 0.1).sum() >= 4
    hedge = inside(found, (-3.0, 3.0), (street.HEDGE.low[1], street.HEDGE.high[1] + 0.1))
    assert len(np.unique(np.floor(hedge[:, 0] / 0.2))) >= 24, "of 30 pieces of 6 m"


@pytest.mark.parametrize("bias", BIASES)
@pytest.mark.parametrize("seed", [11, 12, 13])
def test_kerbs_of_12_cm_are_found(robot: Robot, params: PerceptionParams, bias: tuple[float, float], seed: int) -> None:
    """Beside the robot, 3.5 m to either side."""
    found = cloud(robot, params, bias, seed)
    for edge_m in (street.HALF_ROAD_M, -street.HALF_ROAD_M):
        front = inside(found, (-2.0, 2.0), (edge_m - 0.3, edge_m + 0.3))
        assert len(np.unique(np.floor(front[:, 0] / 0.1))) >= 32, "80 % of 4 m"
