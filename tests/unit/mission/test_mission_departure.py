"""After a long standstill a warning precedes any autonomous motion, whatever caused the standstill."""

from __future__ import annotations

import math

import pytest

from robot_stack.contract.display import Display
from robot_stack.core.departure import Departure
from robot_stack.core.geometry import Twist2
from robot_stack.mission import events as ev
from robot_stack.mission.states import State

from .conftest import DEPARTURE, STILL, TICK_S, DockStory, Story, make_mission

DOCK = {"dock": "chair_1"}
MOVING = Twist2(0.5, 0.0, 0.0)


@pytest.fixture
def story(params) -> DockStory:
    return DockStory(params)


def warned(story: Story) -> float:
    """Returns the seconds until the goal is sent. The display shows driving during all of that time."""
    begun_s = story.now_s
    while story.goal is None and story.call is None:
        assert story.now_s < begun_s + 20.0, "it never sets out"
        story.tick()
        if story.goal is None and story.call is None:
            assert "about to start: warning" in story.status.reason
            assert story.status.display in (
                Display.NAVIGATING,
                Display.TRANSPORT,
                Display.APPROACHING_CHAIR,
                Display.PASSENGER_DISEMBARK,
            )
    return story.now_s - begun_s


def begin(story: Story, *actions) -> Story:
    """Sends START_MISSION without a tick after it."""
    return story.happens(ev.Command(ev.START_MISSION, make_mission(*actions)))


# --- the mission -----------------------------------------------------------------------------------------------------


def test_a_mission_sets_out_two_seconds_after_its_start(story):
    begin(story, "park")
    assert (story.state, story.goal) == (State.RUNNING, None)
    assert story.status.last_command_accepted
    assert warned(story) == pytest.approx(2.0, abs=2 * TICK_S)
    assert story.goals() == [2.0]
    assert story.tick().status.reason == ""


def test_a_pause_within_the_warning_takes_it_back_and_resume_warns_in_full(story):
    begin(story, "park").tick(1.5).happens(ev.Command(ev.PAUSE))
    assert (story.state, story.goal) == (State.PAUSED, None)
    story.tick(1.0).happens(ev.Command(ev.RESUME))
    assert warned(story) == pytest.approx(2.0, abs=2 * TICK_S)


@pytest.mark.parametrize(("stood_s", "warning_s"), [(8.0, 0.0), (12.0, 2.0)])
def test_resume_warns_after_a_long_stop_only(story, stood_s, warning_s):
    story.start("park").at(0.5, speed=0.5).tick().happens(ev.Command(ev.PAUSE))
    story.at(0.5).tick(stood_s).happens(ev.Command(ev.RESUME))
    assert warned(story) == pytest.approx(warning_s, abs=2 * TICK_S)


@pytest.mark.parametrize(("wait_s", "warning_s"), [(5.0, 0.0), (15.0, 2.0)])
def test_going_on_after_a_wait(story, wait_s, warning_s):
    story.start({"wait": wait_s}, "park").at(1.0, speed=0.5).tick().reach(2.0)
    assert story.state is State.WAITING
    story.clear().goal = None  # clears the goal of the reached waypoint
    while story.state is State.WAITING:
        story.tick()
    left = 0.0 if story.goals() else warned(story)
    assert left == pytest.approx(warning_s, abs=2 * TICK_S)


# --- standing in the middle of a ride ------------------------------------------------------------------------------


@pytest.mark.parametrize("hindrance", [{"faults": ("COLLISION_IMMINENT",)}, {"pose": None}, {"safety_known": False}])
def test_held_for_long_the_goal_is_taken_away_and_given_back_after_a_warning(story, hindrance):
    story.start("park").at(0.5, speed=0.5).tick().at(0.5).given(**hindrance).clear()
    story.tick(9.0)
    assert story.log == [], "a short stop changes nothing"
    story.tick(20.0)
    assert story.log == ["cancel"]
    assert story.status.display != Display.NAVIGATING
    story.at(0.5).given(faults=(), safety_known=True)
    assert warned(story) == pytest.approx(2.0, abs=2 * TICK_S)
    assert story.goals() == [2.0]


def test_obstacle_during_departure_warning_restarts_warning(story):
    begin(story, "park").tick(1.5).given(faults=("COLLISION_IMMINENT",)).tick(0.5)
    assert (story.goal, story.status.display) == (None, Display.OBSTACLE)
    story.given(faults=())
    assert warned(story) == pytest.approx(2.0, abs=2 * TICK_S)


def test_standstill_during_mission_displays_obstacle_then_warns_again(story):
    """A sound starts with a new display state, so the display must show another state before the warning."""
    story.start("park").at(0.5, speed=0.5).tick()
    assert story.status.display == Display.NAVIGATING
    story.at(0.5).tick(2.5)
    assert story.status.display == Display.NAVIGATING
    story.tick(1.0)
    assert story.status.display == Display.OBSTACLE
    while story.goal is not None:
        story.tick()
    story.tick()
    assert story.status.display == Display.NAVIGATING
    assert "about to start: warning" in story.status.reason


# --- docking ---------------------------------------------------------------------------------------------------------


def test_no_warning_while_the_docking_controller_is_not_there(story):
    story.start(DOCK).at(1.0, speed=0.5).tick().arrive(2.0).given(faults=("COLLISION_IMMINENT",)).tick(15.0)
    story.given(faults=(), docking_served=False).tick(5.0)
    assert "about to start: warning" not in story.status.reason
    story.given(docking_served=True)
    assert warned(story) == pytest.approx(2.0, abs=2 * TICK_S)


# --- the clock of it -------------------------------------------------------------------------------------------------


def test_departure_counts_unknown_or_nan_twist_as_standstill(params):
    for twist in (None, Twist2(math.nan, 0.0, 0.0), STILL):
        departure = Departure(DEPARTURE)
        departure.elapse(MOVING, 1.0)
        assert not departure.due
        departure.elapse(twist, DEPARTURE.after_s)
        assert not departure.due, "10 s are not more than 10 s"
        departure.elapse(twist, 0.1)
        assert departure.due


def test_a_warning_that_led_to_nothing_is_good_for_ten_seconds(params):
    departure = Departure(DEPARTURE)
    assert not departure.cleared(0.1)
    assert departure.warning
    while not departure.cleared(0.1):
        departure.elapse(STILL, 0.1)
    assert not departure.warning
    departure.elapse(STILL, DEPARTURE.after_s)
    assert departure.cleared(0.1)
    departure.elapse(STILL, 0.1)
    assert not departure.cleared(0.1)


def test_motion_within_a_warning_ends_it(params):
    departure = Departure(DEPARTURE)
    assert not departure.cleared(0.1)
    departure.elapse(MOVING, 0.1)
    assert departure.cleared(0.1)
    assert not departure.warning
