"""Resolving a stand-off with a person waiting for the robot."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.site_map import OCCUPIED, Grid
from robot_stack.navigation.local_map import LocalMap
from robot_stack.navigation.local_map import local_map as made_of
from robot_stack.navigation.world_model import WorldModel
from robot_stack.navigation.yielding import nearest_m, way_out
from tests.unit.navigation.plant import ROBOT, params
from tests.unit.navigation.test_among_obstacles import Array, Story, corridor, reached

HERE, FOOTPRINT, P = Pose2(0.0, 0.0, 0.0), ROBOT.footprint, params().give_way
MARGIN_M = params().local.governor_margin_m


def around(*boxes: tuple[float, float, float, float]) -> LocalMap:
    """Returns a map of 10 m x 10 m around the origin with obstacles at (x0, x1, y0, y1)."""
    axis = (np.arange(200) + 0.5) * 0.05 - 5.0
    x, y = np.meshgrid(axis, axis)
    lethal = np.zeros(x.shape, np.bool_)
    for x0, x1, y0, y1 in boxes:
        lethal |= (x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)
    cells = np.where(lethal, 100, 0).astype(np.int8)
    return made_of(1.0, 0.05, Pose2(-5.0, -5.0, 0.0), cells, np.zeros_like(lethal))


def standing(*at: tuple[float, float]) -> Array:
    return np.array([(x, y, 0.0, 0.0, 0.25, 0.22) for x, y in at]).reshape(-1, 6)


def test_nearest_is_from_edge_to_edge() -> None:
    assert nearest_m(HERE, FOOTPRINT, standing((1.0, 0.0), (0.0, 3.0))) == pytest.approx(1.0 - 0.5 - 0.25)
    assert nearest_m(HERE, FOOTPRINT, standing()) == math.inf


WALLS = ((-4.0, 4.0, 0.65, 0.75), (-4.0, 4.0, -0.75, -0.65))
CAGE = ((-4.0, 4.0, 0.6, 0.7), (-4.0, 4.0, -0.7, -0.6), (-0.8, -0.7, -1.0, 1.0))


def test_gives_way_away_from_people_and_not_into_a_wall() -> None:
    def way(boxes: tuple[tuple[float, float, float, float], ...], *people: tuple[float, float]) -> Twist2 | None:
        return way_out(HERE, FOOTPRINT, around(*boxes), standing(*people), MARGIN_M, P)

    back = way((), (1.0, 0.0))
    assert back is not None
    assert back.vx < -0.1
    assert (back.speed(), back.omega) == (pytest.approx(P.speed_mps), 0.0)
    in_a_corridor = way(WALLS, (1.0, 0.1))
    assert in_a_corridor is not None
    assert in_a_corridor.vx < -0.2
    assert abs(in_a_corridor.vy) < 1e-6
    between = way((), (0.95, 0.0), (-0.95, 0.0))
    assert between is None or abs(between.vy) > abs(between.vx)
    assert way(CAGE, (1.0, 0.1)) is None, "enclosed"
    assert way((), (0.5 + 0.25 + P.room_m + 0.1, 0.0)) is None, "enough room"


def test_gives_way_to_no_step_that_only_the_map_has() -> None:
    cells = np.zeros((200, 200), np.int8)
    cells[90:93] = OCCUPIED  # 0.35 m beside the robot's right edge
    world = WorldModel(params(use_costmap=True), Grid(0.1, -10.0, -10.0, cells))
    world.on_costmap(1.0, 0.05, Pose2(-5.0, -5.0, 0.0), np.zeros((200, 200), np.int8), 1.0)
    assert world.local is not None
    aside = way_out(HERE, FOOTPRINT, world.local, standing((0.0, 1.2)), MARGIN_M, P)
    assert aside is None or aside.vy > -0.1


class Stubborn:
    """Walks through a gate of 1.4 m towards the robot, stops in front of it, and continues once there is room."""

    def __init__(self) -> None:
        self.x, self.at_s, self.begun = 10.5, 10.0, False

    def paint(self, now_s: float, x: Array, y: Array) -> np.ndarray:
        return np.hypot(x - self.x, y - 5.0) < 0.25

    def step(self, now_s: float, robot: Pose2) -> None:
        dt_s, self.at_s = now_s - self.at_s, now_s
        self.begun = self.begun or robot.x > 6.0
        if not self.begun:
            return
        beside = abs(robot.y - 5.0) > 0.4 + 0.25 + 0.2
        if self.x - robot.x > 0.5 + 0.25 + 0.6 or beside or self.x < robot.x:
            self.x -= 0.8 * dt_s


def test_robot_gives_way_to_pedestrian_in_a_gate() -> None:
    cells = corridor().occupancy.copy()
    walker = Stubborn()

    def paint(now_s: float, x: Array, y: Array) -> np.ndarray:
        wall = (abs(x - 8.05) < 0.06) & (abs(y - 5.0) > 0.7)
        return wall | walker.paint(now_s, x, y)

    cells[:43, 80] = cells[57:, 80] = OCCUPIED
    story = Story(paint, Grid(0.1, 0.0, 0.0, cells))
    assert story.go(Pose2(13.0, 5.0, 0.0)) == ""
    assert story.controller.recoveries == 0
    texts = set()
    for _ in range(round(90.0 / 0.05)):
        output = story.tick()
        walker.step(story.now_s, story.drive.pose)
        texts.add(output.text)
        gap_m = nearest_m(story.drive.pose, FOOTPRINT, standing((walker.x, 5.0)))
        assert gap_m > 0.1, "nobody is touched"
        if reached(output):
            break
    assert story.outputs[-1].reached, story.outputs[-1].text
    assert "giving way to a pedestrian" in texts
    assert story.controller.recoveries > 0
