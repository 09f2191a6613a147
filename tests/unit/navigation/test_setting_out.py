"""A goal given by hand after a long standstill warns of the departure before the robot moves."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from robot_stack.core.config import load
from robot_stack.core.departure import SETTING_OUT, Departure, DepartureParams
from robot_stack.core.geometry import ZERO_TWIST, Pose2
from robot_stack.core.limits import NO_LIMIT, SpeedLimit
from robot_stack.navigation.states import NavigationState
from tests.unit.navigation.plant import Ride, ride
from tests.unit.navigation.test_among_obstacles import Story, box, corridor

GOAL = Pose2(1.0, 0.0, 0.0)
PARAMS = load(DepartureParams, "departure")


@pytest.fixture
def stood() -> Ride:
    """A robot whose departure has not been announced."""
    return ride(departure=Departure(PARAMS))


def warned_s(story: Ride, limit_s: float = 30.0) -> float:
    """Returns the seconds until the first motion."""
    begun_s = story.now_s
    while story.tick().twist == ZERO_TWIST:
        assert story.now_s < begun_s + limit_s, story.outputs[-1].text
    return story.now_s - begun_s


def test_it_warns_for_two_seconds_shows_its_plan_meanwhile_and_drives(stood: Ride) -> None:
    assert stood.go(GOAL) == ""
    first = stood.tick()
    assert (first.twist, first.state, first.text) == (ZERO_TWIST, NavigationState.HELD, SETTING_OUT)
    assert stood.controller.path is not None
    assert warned_s(stood) == pytest.approx(PARAMS.warning_s, abs=0.11)
    assert stood.until_reached().reached


def test_a_second_goal_soon_after_needs_no_warning(stood: Ride) -> None:
    stood.go(Pose2(0.0, 0.0, 0.0))
    assert stood.until_reached(1.0).reached, "nor one at the present pose"
    stood.controller._departure.announced()
    stood.go(GOAL)
    assert warned_s(stood) < 0.2, "nor one after a warning of the mission manager"
    stood.until_reached()
    stood.run(PARAMS.after_s - 1.0)
    stood.go(Pose2(0.0, 0.0, 0.0))
    assert warned_s(stood) < 0.2
    stood.until_reached()
    stood.run(PARAMS.after_s + 1.0)
    stood.go(GOAL)
    assert warned_s(stood) > PARAMS.warning_s - 0.1


@pytest.mark.parametrize("hindrance", ["emergency stop", "no pose", "speed limit"])
def test_forbidden_motion_cancels_the_warning(stood: Ride, hindrance: str) -> None:
    stood.go(GOAL)
    stood.run(1.5)
    stood.emergency_stop = hindrance == "emergency stop"
    stood.pose_known = hindrance != "no pose"
    stood.controller.set_speed_limit(SpeedLimit(0.0, 0.0) if hindrance == "speed limit" else NO_LIMIT)
    stood.run(1.0)
    assert stood.outputs[-1].text != SETTING_OUT
    stood.emergency_stop, stood.pose_known = False, True
    stood.controller.set_speed_limit(NO_LIMIT)
    if hindrance == "emergency stop":  # the stop drops the goal, so its end starts no motion
        stood.go(GOAL)
    assert warned_s(stood) == pytest.approx(PARAMS.warning_s, abs=0.16)


def test_new_goal_during_the_warning_continues_it_but_not_after_a_cancel(stood: Ride) -> None:
    stood.go(GOAL)
    stood.run(1.0)
    stood.controller.cancel()
    assert stood.tick().state is NavigationState.IDLE
    stood.go(GOAL)
    stood.run(1.0)
    stood.go(Pose2(0.0, 1.0, 0.0))
    assert warned_s(stood) == pytest.approx(PARAMS.warning_s - 1.0, abs=0.16)
    stood.until_reached()
    assert stood.drive.pose.distance_to(Pose2(0.0, 1.0, 0.0)) < 0.05


def test_goal_cancelled_during_the_warning_before_a_route_ends_the_warning() -> None:
    story = Story(box(6.5, 7.5, 4.3, 5.7), corridor())
    story.controller._departure = Departure(PARAMS)
    story.go(Pose2(12.0, 5.0, 0.0))
    story.until(lambda output: output.text == SETTING_OUT and output.state is NavigationState.FOLLOWING, 5.0)
    story.controller.cancel()
    output = story.tick()
    assert (output.state, output.text) == (NavigationState.IDLE, "goal cancelled")
    assert story.controller._departure.remaining_s is None


def test_robot_held_for_long_warns_before_it_continues(stood: Ride) -> None:
    stood.go(Pose2(4.0, 0.0, 0.0))
    stood.run(4.0)
    stood.controller.set_speed_limit(SpeedLimit(0.0, 0.0))
    stood.run(PARAMS.after_s + 2.0)
    stood.controller.set_speed_limit(NO_LIMIT)
    assert warned_s(stood) > PARAMS.warning_s - 0.1
    assert stood.until_reached().reached


def test_one_that_waits_for_a_way_warns_only_when_it_is_free() -> None:
    """No warning is given while waiting, since it would be long before the motion. The goal is not given up."""
    closed_until_s = 10.0 + PARAMS.after_s + 1.5  # before the goal is given up

    def wall(now_s: float, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        return (abs(x - 3.0) < 0.1) & (now_s < closed_until_s)

    story = Story(wall, corridor())
    story.go(Pose2(7.0, 5.0, 0.0))
    texts = []
    for _ in range(round((PARAMS.after_s + 8.0) / 0.05)):
        texts.append((story.now_s, story.tick().text))
    warned = [now_s for now_s, text in texts if text == SETTING_OUT]
    assert warned
    assert min(warned) > closed_until_s - 0.5
    assert max(warned) - min(warned) == pytest.approx(PARAMS.warning_s, abs=0.3)
    assert story.drive.pose.x > 2.5
