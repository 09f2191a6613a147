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

TURNS = [((0.01, 0.025), 11), ((0.02, 0.05), 12), ((0.03, 0.05), 11), ((0.03, 0.05), 13)]


def away(xyz: np.ndarray, solid: Solid) -> np.ndarray:
    """Returns the (n,) distance of each point from a box, in plan."""
    out = [np.maximum(np.maximum(solid.low[i] - xyz[:, i], xyz[:, i] - solid.high[i]), 0.0) for i in (0, 1)]
    return np.asarray(np.hypot(*out))


@pytest.mark.parametrize(("bias", "seed"), TURNS)
@pytest.mark.parametrize("aside_m", [0.0, 1.2])
def test_the_plain_road_is_free_and_what_stands_beside_it_is_found(
    robot: Robot, params: PerceptionParams, bias: tuple[float, float], seed: int, aside_m: float
) -> None:
    """The published cloud of one turn within 8 m. Road: 0.3 m from kerbs and cars."""
    found = made(robot, params, bias).scene(street.sweep(seed, bias, aside_m), 0.0).obstacles
    found = found[np.hypot(found[:, 0], found[:, 1]) < 8.0]
    road = found[np.abs(found[:, 1] + aside_m) < street.HALF_ROAD_M - 0.3]
    beside = [away(road, street.moved(car, aside_m)) < 0.3 for car in street.CARS]
    assert (~np.logical_or.reduce(beside)).sum() == 0
    if aside_m > 0.0:
        return
    left, right = street.CARS
    for car, face_m in ((left, left.low[1]), (right, right.high[1])):
        side = inside(found, (car.low[0], car.high[0]), (face_m - 0.15, face_m + 0.15))
        assert len(np.unique(np.floor(side[:, 0] / 0.2))) >= 18, "of 21 pieces of a side of 4.2 m"
    for pole in street.POLES:
        assert (away(found, pole) < 0.1).sum() >= 4
    hedge = inside(found, (-3.0, 3.0), (street.HEDGE.low[1], street.HEDGE.high[1] + 0.1))
    assert len(np.unique(np.floor(hedge[:, 0] / 0.2))) >= 24, "of 30 pieces of 6 m"
    for edge_m in (street.HALF_ROAD_M, -street.HALF_ROAD_M):
        kerb = inside(found, (-2.0, 2.0), (edge_m - 0.3, edge_m + 0.3))
        assert len(np.unique(np.floor(kerb[:, 0] / 0.1))) >= 32, "80 % of 4 m of a kerb of 12 cm"
