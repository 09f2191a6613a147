"""Passing people who come along the way on one side of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robot_stack.core.geometry import Pose2
from robot_stack.core.people import Person
from robot_stack.navigation.passing import PassingSide, beside
from robot_stack.navigation.world_model import WorldModel
from tests.unit.navigation.plant import ROBOT, params
from tests.unit.navigation.test_among_obstacles import Array

P, CHAIR = params().passing, ROBOT.footprint_with_chair
METRES = np.arange(0.0, 7.05, 0.1)
ROUTE = np.column_stack((METRES, np.zeros((len(METRES), 2)), METRES))
HALF_CORRIDOR_M = 1.5


def side() -> PassingSide:
    return PassingSide(P, params().local.max_offset_m)


def comes(x: float, y: float, vx: float = -1.0, vy: float = 0.0) -> Person:
    return Person(0.0, x, y, vx, vy, radius_m=0.25, walks=True, walked=True)


def stands(x: float, y: float) -> Person:
    return Person(0.0, x, y, radius_m=0.25, walked=True)


def clearance_m(offset_m: float, count: int) -> float:
    return HALF_CORRIDOR_M - 0.5 * CHAIR.width_m - abs(offset_m)


def offsets_m(of: PassingSide, *people: Person) -> Array:
    return of.offsets_m(ROUTE, people, 0.0, 0.9, CHAIR, clearance_m)


@pytest.mark.parametrize("y", [-0.6, 0.4])
def test_people_who_come_find_a_lane_beside_the_robot(y: float) -> None:
    offset_m = offsets_m(side(), comes(5.0, y))[0]
    assert offset_m * y < 0.0
    assert abs(y - offset_m) - 0.25 - 0.5 * CHAIR.width_m >= 0.5
    assert clearance_m(offset_m, 0) >= P.margin_m - 1e-9


@pytest.mark.parametrize(
    "people",
    [
        (),
        (comes(5.0, 1.4),),  # has a lane already
        (comes(4.0, -2.0, 0.0, 1.0),),  # crosses
        (comes(3.0, 0.3, 0.8),),  # goes ahead of the robot
        (comes(CHAIR.rear_m - 0.2, 0.3),),  # has passed
        (stands(5.0, 0.2),),  # too far to have stopped for the robot
        (Person(0.0, 2.0, 0.2, radius_m=0.25),),  # a thing
    ],
    ids=["empty", "lane", "crosses", "ahead", "passed", "far", "thing"],
)
def test_the_route_is_followed_otherwise(people: tuple[Person, ...]) -> None:
    assert not offsets_m(side(), *people).any()


def test_who_has_stopped_before_the_robot_finds_a_lane_too() -> None:
    assert offsets_m(side(), stands(CHAIR.front_m + 0.9, 0.3))[0] < -0.5


def test_the_side_is_kept_while_people_come() -> None:
    of = side()
    first = offsets_m(of, comes(5.0, 0.05))[0]
    assert first < -0.5
    assert offsets_m(of, comes(4.0, -0.05))[0] == first, "no change of side for a sway"
    assert offsets_m(of)[0] == 0.0


def test_the_lane_goes_by_where_they_meet() -> None:
    """A person who changes sides until the robot is there."""
    assert offsets_m(side(), comes(6.0, 0.5, -1.0, -0.5))[0] > 0.0


def test_people_of_a_group_are_remembered_where_the_costmap_shows_something() -> None:
    world = WorldModel(params(use_costmap=True), None)
    shown = np.zeros((200, 200), np.int8)
    shown[98:103, 138:143] = 100  # around (2.0, 0.0)

    def update(at_s: float, cells: np.ndarray, *people: Person) -> tuple[Person, ...]:
        world.on_costmap(at_s, 0.05, Pose2(-5.0, -5.0, 0.0), cells, at_s)
        world.on_people(at_s, people, at_s)
        return world.everybody

    stood = replace(stands(2.0, 0.0), stamp_s=1.0, apart_s=1.0, number=3)
    assert update(1.0, shown, stood) == (stood,)
    (kept,) = update(2.0, shown)
    assert (kept.number, kept.in_group) == (3, True)
    assert world.people == (), "no reason to come nearer or to keep away"
    assert update(30.0, shown) == (kept,)
    assert update(31.5, shown) == (), "for a limited time"
    update(32.0, shown, replace(stood, stamp_s=32.0, apart_s=32.0))
    assert len(update(33.0, shown, replace(stood, stamp_s=33.0, number=4))) == 1, "the same person under another number"
    assert update(34.0, np.zeros_like(shown)) == (), "the place is free"


def test_the_goal_is_reached_and_the_way_behind_people_is_the_route() -> None:
    offset = offsets_m(side(), comes(2.5, 0.4))
    assert offset[0] < -0.5
    assert offset[2.5 + CHAIR.front_m + P.fade_m + 0.1 < METRES].max() == 0.0
    assert offset[-1] == 0.0
    moved = beside(ROUTE, offset)
    assert moved[:, 1] == pytest.approx(offset)
    assert moved[:, 0] == pytest.approx(METRES)
