"""The external display while an operator, without a mission, moves the robot."""

from __future__ import annotations

import pytest

from robot_stack.contract.display import Display
from robot_stack.mission import events as ev

from .conftest import DockStory


@pytest.fixture
def story(params) -> DockStory:
    """A robot at rest, without a mission."""
    return DockStory(params).tick(5.0)


@pytest.mark.parametrize(("aboard", "driving"), [(False, Display.NAVIGATING), (True, Display.TRANSPORT)])
def test_a_goal_by_hand_shows_that_it_drives_from_the_warning_on(story, aboard, driving):
    story.attach(aboard).given(planned=True, setting_out=True).tick(0.5)
    assert story.status.display == driving
    story.at(0.2, speed=0.5).given(setting_out=False).tick(3.0)
    assert story.status.display == driving
    story.at(5.0).given(planned=False).tick()
    assert story.status.display == (Display.PASSENGER_ONBOARD if aboard else Display.IDLE)


def test_standstill_on_manual_goal_displays_obstacle_until_next_departure(story):
    story.at(0.5, speed=0.5).given(planned=True).tick().at(0.5).tick(2.0)
    assert story.status.display == Display.NAVIGATING
    story.tick(1.5)
    assert story.status.display == Display.OBSTACLE
    story.given(setting_out=True).tick()
    assert story.status.display == Display.NAVIGATING


@pytest.mark.parametrize(
    ("inputs", "display"),
    [
        ({"pose": None}, Display.LOCALIZATION_LOST),
        ({"faults": ("COLLISION_IMMINENT",)}, Display.OBSTACLE),
        ({"safety_known": False}, Display.ERROR),
        ({"manual": True}, Display.MANUAL),
    ],
)
def test_cause_of_hold_on_manual_goal_is_displayed(story, inputs, display):
    story.given(planned=True, **inputs).tick()
    assert story.status.display == display


@pytest.mark.parametrize("ended", [ev.ABORT, "FAILED"])
def test_after_a_mission_that_ended_badly_a_goal_drives_it_home(story, ended):
    story.start("park").tick()
    if ended == "FAILED":
        for _ in range(story.params.tries):
            story.stall()
    else:
        story.command(ended)
    story.given(planned=True, setting_out=True).tick()
    assert story.status.display == Display.NAVIGATING


@pytest.mark.parametrize(
    ("aboard", "docking_state", "setting_out", "display"),
    [
        (False, "APPROACH", True, Display.APPROACHING_CHAIR),
        (False, "APPROACH", False, Display.APPROACHING_CHAIR),
        (False, "SEARCH", True, Display.APPROACHING_CHAIR),
        (False, "SEARCH", False, Display.DOCKING),
        (False, "FINE_ALIGN", False, Display.DOCKING),
        (True, "SERVOING", True, Display.PASSENGER_DISEMBARK),
        (True, "SERVOING", False, Display.PASSENGER_DISEMBARK),
    ],
)
def test_a_docking_by_hand(story, aboard, docking_state, setting_out, display):
    story.attach(aboard).given(docking_state=docking_state, setting_out=setting_out).tick()
    assert story.status.display == display


def test_docking_that_warns_within_a_mission_shows(story):
    story.start({"dock": "chair_1"}).at(1.0, speed=0.5).tick().arrive(2.0).tick().accept().feedback("SEARCH").at(2.0)
    story.given(faults=("OBSTACLE_NEAR",)).tick(5.0)
    assert story.status.display == Display.OBSTACLE
    story.given(setting_out=True).tick()
    assert story.status.display == Display.DOCKING
