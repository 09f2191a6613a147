"""A mission's home is a charger: the way there, and the way on once it is charged; a passenger and a low battery."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from robot_stack.contract.states import HeldBy
from robot_stack.core.mission_library import judge
from robot_stack.core.safe_places import SafePlace, SafePlaces
from robot_stack.mission import events as ev
from robot_stack.mission.orders import Operation, Origin
from robot_stack.mission.states import State

from .conftest import DockStory, make_mission

HOME = (-3.0, 0.0, 0.0)
CRITICAL = ("BATTERY_LOW", "BATTERY_CRITICAL")
AT_CHARGER = {"docking_state": "DOCKED", "charging": True}
LEFT = {"docking_state": "IDLE", "charging": False, "faults": ()}
NEARER = SafePlace(name="porch", x=-1.0, y=0.0, yaw=0.0)
FARTHER = SafePlace(name="garage", x=-9.0, y=0.0, yaw=0.0)


@pytest.fixture
def story(params):
    return DockStory(params)


def ride(story: DockStory, *actions: object, home=HOME) -> DockStory:
    return story.command(ev.START_MISSION, make_mission(*actions, home=home, charger="charger"))


def docks(story: DockStory) -> DockStory:
    """Arrives at home, and docks to the charger."""
    return story.arrive(HOME[0]).tick().accept().given(**AT_CHARGER).ends(True)


def at_charger(story: DockStory) -> DockStory:
    """After a mission that ended on a low battery; an order waits."""
    return docks(ride(story, "park").given(battery=0.2).reach(2.0)).order("next", "park")


def test_the_way_home_ends_with_docking_to_the_charger(story):
    at_charger(story)
    assert story.calls() == [("dock", "charger")]
    assert (story.state, story.status.waypoints_completed, story.status.total_waypoints) == (State.COMPLETED, 2, 2)
    story.given(battery=1.0).tick(60.0)
    assert (story.state, story.queues[-1].held_by) == (State.COMPLETED, HeldBy.RESTART), "nothing moves by itself"


@pytest.mark.parametrize("dock", ["chair_1", "nowhere"])
def test_a_home_that_is_no_charger_is_refused(story, dock):
    story.command(ev.START_MISSION, make_mission("park", charger=dock))
    assert (story.state, story.goal) == (State.IDLE, None)
    assert f"the home of 'ride': {dock!r} is no charger; known: charger" in story.status.reason


def test_a_file_names_the_charger_only_if_there_is_one():
    home = {"x": -3.0, "y": 0.0, "yaw": 0.0}
    assert make_mission("park", home=HOME).model_dump(mode="json")["home"] == home
    with_charger = make_mission("park", home=HOME, charger="charger").model_dump(mode="json")
    assert with_charger["home"] == {**home, "dock": "charger"}
    assert judge(with_charger, {"charger": "charger"})[1] == []
    (problem,) = judge(with_charger, {"charger": "station"})[1]
    assert (problem.field, problem.where) == (("home", "dock"), "home.dock")


def test_a_safe_place_of_the_configuration_has_no_charger():
    with pytest.raises(ValidationError, match="a safe place has no dock"):
        SafePlaces(places=(SafePlace(name="porch", x=0.0, y=0.0, yaw=0.0, dock="charger"),))


# --- on from the charger ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("charge", "may_leave"), [(0.89, False), (0.9, True)])
def test_a_release_at_the_charger_needs_a_charged_battery(story, charge, may_leave):
    at_charger(story).given(battery=charge).edit(Operation.RELEASE, origin=Origin.TOUCH_SCREEN)
    assert story.answer.success is may_leave
    story.clear().tick(story.params.next_order_after_s + 3.0)
    assert story.state is (State.UNDOCKING if may_leave else State.COMPLETED)
    assert story.calls() == ([("undock", "")] if may_leave else [])
    assert story.goals() == []


def test_an_order_starts_with_an_undocking(story):
    at_charger(story).given(battery=1.0).edit(Operation.RELEASE).tick(story.params.next_order_after_s + 3.0)
    assert story.journal.records[-1].leaving
    story.given(**LEFT).accept().ends(True).departs()
    assert (story.state, story.goal.x, story.status.total_waypoints) == (State.RUNNING, 2.0, 1)
    assert story.finishes().state is State.COMPLETED
    story.given(**AT_CHARGER).tick(5.0)
    assert story.queues[-1].held_by is HeldBy.DOCKED, "the release was for one departure"


def test_an_undocking_that_was_done_in_a_pause_is_not_repeated(story):
    ride(story.given(docking_state="DOCKED"), "park").tick().accept().command(ev.PAUSE)
    assert story.state is State.PAUSED
    story.ends(False, "cancelled").given(**LEFT).command(ev.RESUME)
    assert (story.state, story.goal.x, len(story.calls())) == (State.RUNNING, 2.0, 1)


def test_a_wheelchair_that_latches_at_the_start_is_not_undocked(story):
    story.given(docking_state="DOCKED").happens(ev.Command(ev.START_MISSION, make_mission("park")))
    assert story.state is State.UNDOCKING
    story.attach().tick(10.0)
    assert (story.state, story.calls()) == (State.PAUSED, [])
    story.command(ev.RESUME)
    assert (story.state, story.calls(), story.goal.x) == (State.RUNNING, [], 2.0)


def test_with_a_wheelchair_attached_at_the_charger_nothing_goes_on_before_it_is_driven_clear_by_hand(story):
    docks(ride(story, "park", "park").given(faults=CRITICAL, battery=0.1).tick()).attach()
    story.given(faults=(), battery=0.95).tick(60.0).command(ev.RESUME)
    assert (story.state, story.status.last_command_accepted) == (State.PAUSED, False)
    assert "clear of the charger by hand" in story.status.reason
    story.given(charging=False).command(ev.RESUME).departs()
    assert (story.state, story.goal.x) == (State.RUNNING, 2.0)


@pytest.mark.parametrize("pause", [False, True])
def test_a_robot_that_charges_by_a_cable_changes_no_destination(story, pause):
    story.start("park", {"wait": 60.0}).given(faults=("COLLISION_IMMINENT",)).tick(15.0).given(charging=True)
    state = (story.command(ev.PAUSE) if pause else story).state
    story.order("a", "park", operation=Operation.REPLACE, origin=Origin.TOUCH_SCREEN)
    assert (story.answer.success, story.state) == (False, state)
    assert "charges" in story.answer.message


# --- the battery becomes critical ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("place", "aboard", "goal_m"), [(NEARER, False, -1.0), (FARTHER, False, -3.0), (FARTHER, True, -9.0)]
)
def test_a_critical_battery_leads_an_empty_robot_to_the_nearer_of_charger_and_safe_place(params, place, aboard, goal_m):
    story = DockStory(params, safe_places=(place,))
    ride(story.attach(aboard), "park").given(faults=CRITICAL).tick()
    assert (story.state, story.goal.x) == (State.RUNNING, goal_m)


def test_at_the_charger_a_person_lets_the_interrupted_mission_go_on(story):
    docks(ride(story, "park", "park").given(faults=CRITICAL, battery=0.1).tick())
    assert (story.state, story.status.waypoints_completed) == (State.PAUSED, 0)
    assert "at the charger 'charger'" in story.status.reason
    story.given(faults=("BATTERY_LOW",)).tick(60.0).command(ev.RESUME)
    assert (story.state, story.status.last_command_accepted) == (State.PAUSED, False)
    story.given(faults=(), battery=0.9).command(ev.RESUME).tick(5.0)  # with its warning
    assert (story.state, story.calls()[-1]) == (State.UNDOCKING, ("undock", ""))
    story.given(**LEFT).accept().ends(True).departs()
    assert (story.state, story.goal.x) == (State.RUNNING, 2.0)
    assert story.finishes().state is State.COMPLETED


# --- a passenger and a low battery -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("actions", "inputs", "starts"),
    [
        (("pass", "undock", "park"), {"battery": 0.2}, True),
        (("undock", {"dock": "charger"}), {"faults": ("BATTERY_LOW",)}, True),
        (("park",), {"battery": 0.2}, False),
        (("undock", {"dock": "chair_1"}), {"battery": 0.2}, False),
        (("undock",), {"faults": CRITICAL}, False),
    ],
)
def test_with_a_low_battery_a_passenger_is_driven_to_where_the_carriage_ends(story, actions, inputs, starts):
    story.attach().given(**inputs).start(*actions)
    assert story.state is (State.RUNNING if starts else State.IDLE)
    assert starts or "no new mission" in story.status.reason or "a new mission needs" in story.status.reason
