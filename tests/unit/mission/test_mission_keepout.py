"""Missions whose waypoints lie in keepout zones of the site are refused."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.core.keepout import Keepout
from robot_stack.core.robot import load_robot
from robot_stack.core.safe_places import SafePlace
from robot_stack.core.zones import Zone, ZoneType
from robot_stack.mission import events as ev
from robot_stack.mission.orders import Operation
from robot_stack.mission.params import MissionParams
from robot_stack.mission.states import State
from tests.unit.mission.conftest import Story, request, waypoints_of

ROBOT = load_robot()
REASON = "waypoint 'w1' of {!r}: the footprint lies in the keepout zone 'lawn'"


@pytest.fixture
def story(params: MissionParams) -> Story:
    """With a zone around the second waypoint, (4, 0)."""
    ring = np.array([(3.9, -0.1), (4.1, -0.1), (4.1, 0.1), (3.9, 0.1), (3.9, -0.1)])
    lawn = Zone("lawn", ZoneType.KEEPOUT, (ring,), np.inf)
    places = (SafePlace(name="on_the_lawn", x=4.0, y=0.5, yaw=0.0), SafePlace(name="porch", x=-9.0, y=0.0, yaw=0.0))
    closed = Keepout((lawn,), ROBOT.footprint, ROBOT.footprint_with_chair)
    return Story(params, safe_places=places, keepout=closed)


def test_a_mission_with_a_waypoint_in_a_keepout_zone_is_refused(story: Story) -> None:
    story.start("pass", "park")
    assert (story.state, story.goal) == (State.IDLE, None)
    assert REASON.format("ride") in story.status.reason
    assert story.start("park").state is State.RUNNING


def test_a_route_of_the_fleet_through_a_keepout_zone_is_refused(story: Story) -> None:
    story.happens(request(Operation.ADD, "one", waypoints_of("pass", "park")))
    assert not story.kernel.queue_answer.success
    assert story.kernel.queue_answer.message == REASON.format("tour")
    story.happens(request(Operation.ADD, "two", waypoints_of("pass"), more_follows=True))
    assert story.kernel.queue_answer.success
    story.happens(request(Operation.EXTEND, "two", waypoints_of("park", first=1), first=1))
    assert story.kernel.queue_answer.message == REASON.format("tour")


def test_a_safe_place_in_a_keepout_zone_is_not_used(story: Story) -> None:
    story.start("park").given(faults=("BATTERY_LOW", "BATTERY_CRITICAL")).tick()
    assert story.goal is not None
    assert story.goal.x == -9.0
    story.command(ev.ABORT)
