"""Places of a site that its keepout zones exclude."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.core.config import load
from robot_stack.core.docks import DocksFile
from robot_stack.core.geometry import Pose2
from robot_stack.core.keepout import Keepout, keepout_problems, load_keepout, site_keepout_problems
from robot_stack.core.mission import Mission
from robot_stack.core.mission_library import judge
from robot_stack.core.robot import load_robot
from robot_stack.core.safe_places import SafePlace, SafePlaces
from robot_stack.core.zones import Zone, ZoneType

ROBOT = load_robot()
DOCKS = {"chair_1": "wheelchair", "charger": "charger"}
FRONT_M, WITH_CHAIR_M = ROBOT.footprint.front_m, ROBOT.footprint_with_chair.front_m


def rectangle(x0: float, x1: float, y0: float, y1: float) -> np.ndarray:
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)])


def keepout(*rings: np.ndarray, name: str = "lawn") -> Keepout:
    return Keepout((Zone(name, ZoneType.KEEPOUT, rings, np.inf),), ROBOT.footprint, ROBOT.footprint_with_chair)


def mission(*stops: tuple[float, object], home_x: float = -20.0) -> Mission:
    """A stop each 1 m of y further: x, action."""
    waypoints = [{"name": f"w{i}", "x": x, "y": 0.0, "yaw": 0.0, "action": what} for i, (x, what) in enumerate(stops)]
    names = {"en": "Ride", "ja": "Ride", "zh": "Ride"}
    home = {"x": home_x, "y": 0.0, "yaw": 0.0}
    return Mission.model_validate({"id": "ride", "name": names, "home": home, "waypoints": waypoints})


@pytest.mark.parametrize(
    ("pose", "inside"),
    [
        (Pose2(0.0, 0.0, 0.0), True),
        (Pose2(-2.0 - FRONT_M + 0.01, 0.0, 0.0), True),
        (Pose2(-2.0 - FRONT_M - 0.01, 0.0, 0.0), False),
        (Pose2(-2.0 - 0.5 * ROBOT.footprint.width_m - 0.01, 0.0, math.pi / 2.0), False),
        (Pose2(0.0, 3.0, 0.0), False),
    ],
)
def test_the_footprint_decides(pose: Pose2, inside: bool) -> None:
    assert keepout(rectangle(-2.0, 2.0, -2.0, 2.0)).zone_at(pose) == ("lawn" if inside else "")


def test_a_zone_smaller_than_the_footprint_or_across_it_counts_and_a_hole_does_not() -> None:
    here = Pose2(0.0, 0.0, 0.3)
    assert keepout(rectangle(0.1, 0.15, 0.0, 0.05)).zone_at(here) == "lawn"
    assert keepout(rectangle(0.05, 0.1, -5.0, 5.0)).zone_at(here) == "lawn"
    ring = rectangle(-5.0, 5.0, -5.0, 5.0)
    assert keepout(ring, rectangle(-2.0, 2.0, -2.0, 2.0)).zone_at(here) == ""
    assert keepout(ring, rectangle(-0.5, 2.0, -2.0, 2.0)).zone_at(here) == "lawn"


def test_a_waypoint_is_compared_with_the_footprint_it_is_reached_with() -> None:
    before_m = -FRONT_M - 0.1  # clear without a wheelchair
    assert before_m + WITH_CHAIR_M > 0.0
    zones = keepout(rectangle(0.0, 2.0, -1.0, 1.0))
    carried = mission((-15.0, {"dock": "chair_1"}), (before_m, "undock"), (before_m, "park"))
    (problem,) = keepout_problems(carried, DOCKS, zones, False)
    text = "waypoint 'w1' of 'ride': the footprint with a wheelchair lies in the keepout zone 'lawn'"
    assert problem == (("waypoints", 1), text)
    assert list(keepout_problems(mission((before_m, "park")), DOCKS, zones, False)) == []
    assert [field for field, _ in keepout_problems(mission((before_m, "park")), DOCKS, zones, True)] == [
        ("waypoints", 0)
    ]
    (home,) = keepout_problems(mission((-5.0, "park"), home_x=1.0), DOCKS, zones, False)
    assert home == (("home",), "the home of 'ride': the footprint lies in the keepout zone 'lawn'")


def test_a_draft_in_a_zone_has_a_problem_at_its_waypoint() -> None:
    draft = mission((-5.0, "pass"), (1.0, "park")).model_dump(mode="json")
    found, (problem,) = judge(draft, DOCKS, keepout(rectangle(0.0, 2.0, -1.0, 1.0)))
    assert found is None
    assert problem.field == ("waypoints", 1)
    assert "keepout zone 'lawn'" in problem.text
    assert judge(draft, DOCKS, keepout(rectangle(0.0, 2.0, 8.0, 9.0)))[1] == []


def test_docks_and_safe_places_in_zones_are_named() -> None:
    docks = load(DocksFile, "docks")
    dock = docks.docks["chair_1"].of_robot(ROBOT, docks.staging_m)
    at = dock.staging
    zones = keepout(rectangle(at.x_m - 0.05, at.x_m + 0.05, at.y_m - 0.05, at.y_m + 0.05))
    porch = SafePlace(name="porch", x=at.x_m - FRONT_M - 0.1, y=at.y_m, yaw=0.0)
    places = SafePlaces(places=(porch, SafePlace(name="base", x=at.x_m + 9.0, y=at.y_m, yaw=0.0)))
    found = dict(site_keepout_problems(docks, places, zones, ROBOT))
    assert "dock 'chair_1', staging pose 1" in found
    assert found["the safe place 'porch'"] == "the footprint with a wheelchair lies in the keepout zone 'lawn'"
    assert not any("base" in where or "charger" in where for where in found)
    docked = (
        docks.docks["charger"]
        .place.pose()
        .compose(docks.docks["charger"].of_robot(ROBOT, docks.staging_m).dock_pose.pose())
    )
    at_charger = keepout(rectangle(docked.x - 0.05, docked.x + 0.05, docked.y - 0.05, docked.y + 0.05))
    assert "dock 'charger', docked pose" in dict(site_keepout_problems(docks, SafePlaces(places=()), at_charger, ROBOT))


def test_a_site_without_a_map_has_no_zones() -> None:
    assert load_keepout("", ROBOT).zones == ()
    assert load_keepout("yard", ROBOT).zones == ()
