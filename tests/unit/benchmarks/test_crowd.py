"""The benchmark ``crowd``: its places and the people in them."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import load_robot
from tests.benchmarks.crowd import PLACES, Passer

FOOTPRINT = load_robot().footprint_with_chair
AWAY, NEAR = Pose2(2.5, 8.0, 0.0), Pose2(9.0, 8.0, 0.0)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("seed", [1, 2])
def test_start_and_goal_are_clear_and_people_walk_clear_of_the_walls(place: str, seed: int) -> None:
    made = PLACES[place](seed, True)
    assert not PLACES[place](seed, False).walkers
    for pose in (made.start, made.goal):
        assert made.clearance_m(pose, FOOTPRINT)[0] > 0.5
    for one in made.walkers:
        line = np.linspace(one.a, one.b, 100)
        assert min(float(box.distance(line).min()) for box in made.boxes) > 0.3


def test_person_enters_late_and_away_from_the_robot_then_passes_once() -> None:
    random, passer = np.random.default_rng(1), Passer((10.0, 8.0), (4.0, 8.0), 1.0, pause_s=2.0)

    def at_after(seconds: float, robot: Pose2) -> float:
        for _ in range(round(seconds / 0.1)):
            passer.step(0.1, robot, FOOTPRINT, random)
        return passer.x

    assert at_after(1.0, AWAY) < 0.0
    assert at_after(4.0, NEAR) < 0.0, "the robot is at the entrance"
    assert at_after(3.0, Pose2(2.5, 14.0, 0.0)) == pytest.approx(7.0, abs=0.3)
    assert at_after(10.0, Pose2(2.5, 14.0, 0.0)) < 0.0
