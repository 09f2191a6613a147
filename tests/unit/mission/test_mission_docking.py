"""Docking and undocking as parts of a mission, tick by tick in fake time."""

from __future__ import annotations

import pytest

from robot_stack.contract.display import Display
from robot_stack.contract.states import HeldBy
from robot_stack.mission import events as ev
from robot_stack.mission.orders import Operation
from robot_stack.mission.record import Record, problem_of
from robot_stack.mission.states import AT_DOCK, State

from .conftest import TICK_S, DockStory, make_mission

DOCK = {"dock": "chair_1"}
CHARGE = {"dock": "charger"}
COMMANDED = {ev.PAUSE: State.PAUSED, ev.ABORT: State.ABORTED, ev.EMERGENCY_STOP: State.STOPPED}


@pytest.fixture
def story(params) -> DockStory:
    return DockStory(params)


@pytest.fixture
def docking(story) -> DockStory:
    """A mission at w0 whose docking goal the docking controller has accepted."""
    story.start(DOCK, "pass", "undock", "park").reach(2.0).tick()
    assert story.state is State.DOCKING
    return story.accept().clear()


@pytest.fixture
def undocking(story) -> DockStory:
    story.start(DOCK, "undock", "park").reach(2.0).tick().docks().reach(4.0).tick()
    assert story.state is State.UNDOCKING
    return story.accept().clear()


# --- the ride --------------------------------------------------------------------------------------------------------


def test_the_main_job(story):
    story.start("pass", DOCK, "pass", "undock", "park")
    story.at(2.0, speed=1.0).tick().reach(4.0).tick()
    assert (story.state, story.calls()) == (State.DOCKING, [("dock", "chair_1")])
    story.docks()
    assert (story.state, story.goals()[-1], story.status.passenger_attached) == (State.RUNNING, 6.0, True)
    story.at(6.0, speed=1.0).tick().reach(8.0).tick()
    assert (story.state, story.calls()[-1]) == (State.UNDOCKING, ("undock", "chair_1"))
    story.accept().attach(False).ends(True)
    assert (story.state, story.goals()[-1]) == (State.RUNNING, 10.0)
    story.reach(10.0)
    assert story.state is State.COMPLETED
    assert len(story.calls()) == 2


def test_docking_state_is_journaled_before_docking_goal_is_sent(story):
    order: list[str] = []
    story.start(DOCK, "park")
    story.journal.save = lambda record: order.append(record.state.value)
    story.cancel_goal = lambda everything: order.append("cancel")
    start = story.start_docking
    story.start_docking = lambda *goal: (order.append("dock"), start(*goal))
    story.reach(2.0).tick()
    assert order == ["cancel", "DOCKING", "dock"], "and navigation has no goal of its own meanwhile"


@pytest.mark.parametrize("where", ["drives", "waits"])
def test_a_passenger_undocked_by_hand_pauses_the_ride_for_a_person(story, where):
    story.attach().start({"wait": 60.0}, "park").at(1.0, speed=0.5).tick()
    if where == "waits":
        assert story.reach(2.0).state is State.WAITING
    story.attach(False)
    assert (story.state, story.goal, "undocked" in story.status.reason) == (State.PAUSED, None, True)
    assert story.tick(90.0).state is State.PAUSED
    assert story.command(ev.RESUME).state is State.RUNNING


@pytest.mark.parametrize(("dock", "stayed"), [("docking", "false"), ("undocking", "true")])
def test_a_success_needs_the_passenger_as_well(dock, stayed, request):
    story = request.getfixturevalue(dock)
    words = "docking to chair_1" if dock == "docking" else "undocking from chair_1"
    story.ends(True).tick(1.0)
    assert story.state in AT_DOCK
    assert story.status.reason == f"{words}: waiting for /passenger_attached"
    story.tick(story.params.docking_confirm_s)
    assert story.state is State.FAILED
    assert story.status.reason == f"{words} failed: it succeeded, but /passenger_attached stayed {stayed}"


def test_an_open_route_waits_at_a_station_and_goes_on_with_the_undocking(story):
    story.brings(CHARGE).reach(2.0).tick().accept().given(docking_state="DOCKED", charging=True).ends(True).tick(60.0)
    assert (story.state, story.queues[-1].held_by) == (State.WAITING, HeldBy.NOTHING)
    story.extends("undock", "park", first=1, more_follows=False).tick(5.0)
    assert (story.goals(), story.calls()[-1]) == ([2.0], ("undock", "charger"))
    story.accept().given(docking_state="IDLE", charging=False).ends(True).departs()
    assert story.finishes().state is State.COMPLETED
    assert story.tick(5.0).queues[-1].held_by is HeldBy.NOTHING


@pytest.mark.parametrize("charging", [True, False])
def test_no_robot_drives_out_of_a_station_whatever_the_docking_controller_reports(story, charging):
    """A full battery does not charge, and a docking controller that has just started reports IDLE."""
    story.brings(CHARGE).reach(2.0).tick().accept().given(docking_state="DOCKED", charging=charging).ends(True)
    story.given(docking_state="IDLE").tick(60.0)
    story.extends("undock", "park", first=1, more_follows=False).tick(5.0)
    assert (story.goals(), story.calls()[-1]) == ([2.0], ("undock", "charger"))
    story.ends(False, "nothing is attached").tick(60.0)
    assert (story.state, story.goals()) == (State.FAILED, [2.0])
    assert story.status.reason == "undocking from charger failed: nothing is attached"


def test_a_robot_that_is_driven_by_hand_in_the_wait_at_a_charger_is_resumed_by_a_person_only(story):
    story.brings(CHARGE).reach(2.0).tick().accept().given(docking_state="DOCKED").ends(True).tick(1.0)
    story.given(manual=True).at(5.0).tick(1.0).given(manual=False).tick(5.0)
    assert (story.state, story.queues[-1].paused_by) == (State.PAUSED, None)
    assert story.status.reason == "driven by hand in the wait for the next part; RESUME goes on"
    story.extends("undock", "park", first=1, more_follows=False).tick(60.0)
    assert story.asks(Operation.RESUME).answer.success is False
    assert (story.state, story.goals(), len(story.calls())) == (State.PAUSED, [2.0], 1)
    story.command(ev.RESUME).tick(5.0)
    assert story.calls()[-1] == ("undock", "charger")


def test_a_robot_docked_to_a_station_does_not_drive_home_on_a_low_battery(story):
    story.command(ev.START_MISSION, make_mission(CHARGE, home=(50.0, 0.0, 0.0))).given(battery=0.2)
    story.reach(2.0).tick().accept().ends(True)
    assert story.state is State.COMPLETED


# --- missions rejected at the start ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("actions", "aboard", "why"),
    [
        ((DOCK, "park"), True, "waypoint 'w0' of 'ride' docks to 'chair_1', but the robot is already carrying"),
        ((DOCK, DOCK), False, "waypoint 'w1' of 'ride' docks to 'chair_1', but the robot is already carrying"),
        (("pass", "undock"), False, "waypoint 'w1' of 'ride' undocks, but no wheelchair is attached then and "),
        ((DOCK, "undock", "undock"), False, "waypoint 'w2' of 'ride' undocks, but no wheelchair"),
        (({"dock": "chair_9"}, "park"), False, "waypoint 'w0' of 'ride': there is no dock 'chair_9'; known: chair_1, "),
        ((CHARGE, "park"), False, "waypoint 'w1' of 'ride' leaves the dock 'charger' without an undock before"),
        ((CHARGE, DOCK), False, "waypoint 'w1' of 'ride' docks to 'chair_1', but the robot is already docked"),
        ((CHARGE,), True, "waypoint 'w0' of 'ride' docks to 'charger', but the robot is already carrying"),
    ],
)
def test_mission_with_impossible_docking_is_rejected_at_start(story, actions, aboard, why):
    story.attach(aboard).start(*actions)
    assert story.state is State.IDLE
    assert story.log == []
    assert why in story.status.reason
    assert not story.status.last_command_accepted


# --- failures --------------------------------------------------------------------------------------------------------


def test_a_failed_docking_ends_the_mission_with_its_reason(docking):
    docking.ends(False, "no marker in sight (MARKERS_NOT_FOUND)")
    assert docking.state is State.FAILED
    assert docking.status.reason == "docking to chair_1 failed: no marker in sight (MARKERS_NOT_FOUND)"
    assert docking.status.display == Display.DOCKING_FAILED
    docking.tick(60.0)
    assert docking.calls() == [], "the docking controller has tried again, the mission does not"


def test_docking_failure_without_text_fails_with_default_reason(docking):
    docking.ends(False)
    assert docking.status.reason == "docking to chair_1 failed: no reason given"


def test_without_a_docking_controller(story):
    story.start(DOCK).given(docking_served=False, docking_state="").reach(2.0).tick()
    assert story.status.reason == "docking to chair_1: waiting for docking_controller"
    assert story.status.state == "RUNNING"
    story.tick(story.params.docking_wait_s - 1.0)
    assert story.state is State.DOCKING
    story.tick(1.0)
    assert story.state is State.FAILED
    assert story.status.reason == "docking to chair_1 failed: timed out after 10 s waiting for docking_controller"
    assert story.calls() == []


@pytest.mark.parametrize("state", ["APPROACH", "SEARCH", "SERVOING", "FINE_ALIGN"])
def test_docking_waits_until_busy_docking_controller_is_idle(story, state):
    story.start(DOCK).given(docking_state=state).reach(2.0).tick()
    assert story.calls() == []
    why = "waiting for docking_controller to end its present goal"
    assert story.status.reason == f"docking to chair_1: {why}"
    story.given(docking_state="IDLE").tick()
    assert story.calls() == [("dock", "chair_1")]


def test_a_goal_waits_until_the_robot_stands(story):
    story.start(DOCK).arrive(2.0).at(2.0, speed=0.2).tick()
    assert story.status.reason == "docking to chair_1: waiting for standstill of the robot"
    assert story.calls() == []
    story.at(2.0).tick()
    assert story.calls() == [("dock", "chair_1")]


@pytest.mark.parametrize("hindrance", [{"safety_known": False}, {"faults": ("COLLISION_IMMINENT",)}, {"pose": None}])
def test_while_the_robot_may_not_move_no_docking_begins_and_no_time_counts(story, hindrance):
    story.start(DOCK).arrive(2.0)
    before = story.inputs
    story.given(**hindrance).tick(3 * story.params.docking_wait_s)
    assert (story.state, story.calls()) == (State.DOCKING, [])
    assert story.status.reason.startswith(("docking to chair_1: held", "docking to chair_1: waiting for pose"))
    story.inputs = before
    story.departs()
    assert story.calls() == [("dock", "chair_1")]


def test_unanswered_docking_goal_times_out_and_is_cancelled(story):
    story.start(DOCK).reach(2.0).tick().tick(story.params.docking_wait_s)
    assert story.state is State.FAILED
    assert story.status.reason == "docking to chair_1 failed: docking_controller has not answered for 10 s"
    assert story.call is None, "it is cancelled, in case it was taken after all"


def test_a_result_that_never_comes(docking):
    docking.tick(docking.params.docking_timeout_s - 1.0)
    assert docking.state is State.DOCKING
    docking.tick(1.0)
    assert docking.state is State.FAILED
    assert docking.status.reason == "docking to chair_1 failed: no result within 240 s"
    assert "cancel docking" in docking.log


def test_a_docking_controller_that_dies(docking):
    docking.given(docking_state="", docking_served=False).tick()
    assert docking.state is State.FAILED
    assert docking.status.reason == "docking to chair_1 failed: docking_controller is not available"


def test_a_docking_controller_that_falls_silent(docking):
    docking.given(docking_state="").tick(docking.params.docking_silence_s - TICK_S)
    assert docking.state is State.DOCKING
    docking.tick()
    assert docking.state is State.FAILED
    assert docking.status.reason == "docking to chair_1 failed: no status of docking_controller for 3 s"
    assert docking.call is None


def test_feedback_is_a_sign_of_life(docking):
    docking.given(docking_state="")
    for _ in range(20):
        docking.tick(2.0).feedback("SERVOING")
    assert docking.state is State.DOCKING


# --- results of other goals ------------------------------------------------------------------------------------------


def test_a_late_result_of_an_old_goal_is_not_taken_for_the_new_one(docking):
    old = docking.called()
    docking.command(ev.PAUSE).command(ev.RESUME).tick()
    assert docking.calls() == [], "the old goal has not ended: the new one would receive that all is busy"
    assert "to end its present goal" in docking.status.reason
    docking.attach().ends(True, call=old)
    docking.attach(False)
    assert docking.state is State.DOCKING
    docking.tick()
    new = docking.called()
    assert new != old
    docking.accept().ends(False, "old", call=old).ends(True, call=old).feedback("FAILED", call=old)
    assert docking.state is State.DOCKING
    docking.attach().ends(True, call=new)
    assert docking.state is State.RUNNING


def test_an_old_goal_that_does_not_end(docking):
    docking.command(ev.PAUSE).tick(10.0).clear().command(ev.RESUME)
    docking.tick(docking.params.docking_wait_s + TICK_S)
    assert docking.state is State.FAILED
    why = "timed out after 10 s waiting for docking_controller to end its present goal"
    assert docking.status.reason == f"docking to chair_1 failed: {why}"
    assert docking.log.count("cancel docking") >= 4, "it is cancelled again and again"


def test_a_goal_of_one_that_died_is_not_waited_for(docking):
    docking.command(ev.PAUSE).given(docking_served=False, docking_state="").tick()
    docking.given(docking_served=True, docking_state="IDLE").command(ev.RESUME).tick()
    assert docking.calls() == [("dock", "chair_1")]


# --- commands and the emergency stop ---------------------------------------------------------------------------------


def test_a_cancelled_goal_is_cancelled_until_it_has_ended(docking):
    call = docking.called()
    docking.command(ev.PAUSE).clear().tick(4.5)
    assert docking.log.count("cancel docking") == 2  # one attempt every 2 s
    docking.ends(False, "cancelled", call=call).clear().tick(10.0)
    assert docking.log == []
    assert docking.state is State.PAUSED


def test_resume_undocks_again_where_the_robot_stands(undocking):
    call = undocking.called()
    undocking.command(ev.PAUSE).ends(False, "cancelled", call=call).clear().command(ev.RESUME).tick()
    assert undocking.calls() == [("undock", "chair_1")]
    assert undocking.goals() == [], "the chair may be unlatched already: driving forward would push it"


@pytest.mark.parametrize("dock", ["docking", "undocking"])
def test_emergency_stop_until_release_and_resume(dock, request):
    story = request.getfixturevalue(dock)
    state, call = story.state, story.called()
    story.emergency(True)
    assert (story.state, story.status.state, story.call) == (State.STOPPED, "PAUSED", None)
    story.ends(False, "emergency stop (SAFETY_STOP)", call=call, safety_stop=True).command(ev.RESUME)
    assert story.state is State.STOPPED
    story.emergency(False).tick(30.0)
    assert (story.state, story.calls()) == (State.STOPPED, [])
    story.command(ev.RESUME).tick()
    assert story.state is state
    assert len(story.calls()) == 1


@pytest.mark.parametrize("emergency", [True, False])
def test_a_safety_stop_waits_for_the_emergency_stop_and_fails_without_one(docking, emergency):
    docking.ends(False, "held (SAFETY_STOP)", safety_stop=True).tick(1.0)
    assert docking.state is State.DOCKING
    if emergency:
        assert docking.emergency(True).state is State.STOPPED
        return
    docking.tick(docking.params.docking_confirm_s)
    assert docking.state is State.FAILED
    assert docking.status.reason == "docking to chair_1 failed: held (SAFETY_STOP)"


# --- journal and restart ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("state", [State.DOCKING, State.UNDOCKING])
def test_docking_record_at_waypoint_without_dock_is_invalid(state):
    assert problem_of(Record(state, make_mission("park"))).startswith(
        f"state {state.value} at a waypoint that does not"
    )


# --- status ----------------------------------------------------------------------------------------------------------


def test_the_reason_follows_the_feedback(story):
    docking = story.start(DOCK, "park").arrive(2.0).tick()
    assert docking.status.reason == "docking to chair_1: waiting for an answer"
    docking.accept().feedback("SEARCH")
    assert (docking.status.state, docking.status.reason) == ("RUNNING", "docking to chair_1: SEARCH")
    docking.feedback("SERVOING", tries=2)
    assert docking.status.reason == "docking to chair_1: SERVOING, try 2"
    assert docking.status.current_waypoint == "w0"
    docking.given(faults=("COLLISION_IMMINENT",)).tick()
    assert docking.status.reason == "docking to chair_1: SERVOING, try 2; held by safety: COLLISION_IMMINENT"


def test_repeated_docking_feedback_limits_status_messages(docking):
    docking.feedback("SEARCH").clear()
    for _ in range(100):
        docking.feedback("SEARCH")
    assert 9 <= len(docking.statuses) <= 11


def test_the_display_through_the_main_job(story):
    shown: list[int] = []

    def note() -> None:
        if story.status.display != (shown[-1] if shown else None):
            shown.append(story.status.display)

    publish = story.publish_status
    story.publish_status = lambda status: (publish(status), note())
    long_s, short_s = story.params.announcement_s + 1.0, story.params.announcement_s - 0.5
    story.start("pass", DOCK, "pass", "undock", "park").at(2.0, speed=1.0).tick().tick().reach(4.0).tick().accept()
    for state in ("APPROACH", "SEARCH", "SERVOING", "FINE_ALIGN", "DOCKED"):
        story.feedback(state)
    story.attach().ends(True).tick(short_s).at(6.0, speed=1.0).tick().reach(8.0).tick().accept()
    story.feedback("UNLATCHING").tick(long_s).attach(False).ends(True).tick(short_s)
    story.at(9.0, speed=1.0).tick().reach(10.0)
    assert shown == [
        Display.NAVIGATING,
        Display.APPROACHING_CHAIR,
        Display.DOCKING,
        Display.DOCKING_COMPLETE,
        Display.PASSENGER_ONBOARD,
        Display.TRANSPORT,
        Display.DESTINATION_REACHED,
        Display.PASSENGER_DISEMBARK,
        Display.NAVIGATING,
        Display.IDLE,
    ]


def test_an_announcement_lasts_its_time(docking):
    docking.attach().ends(True)
    for display in (Display.DOCKING_COMPLETE, Display.PASSENGER_ONBOARD):
        begun_s = docking.now_s
        assert docking.status.display == display
        while docking.status.display == display:
            docking.tick()
        assert docking.now_s - begun_s == pytest.approx(docking.params.announcement_s, abs=2 * TICK_S)


def test_no_announcement_hides_an_emergency_stop(docking):
    docking.attach().ends(True).emergency(True)
    assert docking.status.display == Display.EMERGENCY_STOP


def test_an_obstacle_shows_while_docking_but_a_lost_localization_does_not(docking):
    docking.feedback("SERVOING").given(faults=("LOCALIZATION_LOST",)).tick()
    assert docking.status.display == Display.DOCKING
    docking.given(faults=("COLLISION_IMMINENT",)).tick()
    assert docking.status.display == Display.OBSTACLE


def test_an_obstacle_beside_shows_while_docking_once_the_robot_has_stood_for_it(docking):
    docking.at(2.1, speed=0.1).feedback("SERVOING").at(2.1).given(faults=("OBSTACLE_NEAR",)).tick(2.0)
    assert docking.status.display == Display.DOCKING, "it stands for moments between its steps"
    docking.tick(2.0)
    assert docking.status.display == Display.OBSTACLE


@pytest.mark.parametrize(
    ("state", "display"),
    [
        ("APPROACH", Display.APPROACHING_CHAIR),
        ("SEARCH", Display.DOCKING),
        ("SERVOING", Display.DOCKING),
        ("FINE_ALIGN", Display.DOCKING),
        ("DOCKED", Display.DOCKING_COMPLETE),
        ("FAILED", Display.DOCKING_FAILED),
        ("IDLE", Display.IDLE),
        ("", Display.IDLE),
    ],
)
def test_manual_docking_without_mission_is_displayed(story, state, display):
    story.given(docking_state=state).tick()
    assert story.status.display == display


# --- a latch that does not hold ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("faults", "held_by"), [(("LATCH_NOT_CLOSED",), ""), (("LATCH_NOT_CLOSED", "TILT"), "held by safety: TILT")]
)
def test_a_latch_that_does_not_hold_the_wheelchair_is_no_reason_against_undocking(undocking, faults, held_by):
    """The safety monitor stops all motion but an undocking."""
    call = undocking.called()
    undocking.command(ev.PAUSE).ends(False, "cancelled", call=call).clear()
    undocking.given(faults=faults, docking_state="FAILED").command(ev.RESUME).tick()
    assert undocking.state is State.UNDOCKING
    assert undocking.calls() == ([] if held_by else [("undock", "chair_1")])
    assert undocking.status.reason == f"undocking from chair_1: {held_by or 'waiting for an answer'}"


def test_a_docking_whose_latch_may_hold_is_not_taken_for_done(docking):
    """An emergency stop while the latch closes: the wheelchair counts as attached, and only undocking is permitted."""
    docking.attach().ends(False, "emergency stop (SAFETY_STOP)", safety_stop=True).emergency(True).emergency(False)
    docking.given(faults=("LATCH_NOT_CLOSED",), docking_state="FAILED").command(ev.RESUME)
    assert (docking.state, docking.status.last_command_accepted) == (State.STOPPED, False)
    assert "undock first" in docking.status.reason
    calls = len(docking.calls())
    docking.attach(False).given(faults=(), docking_state="IDLE").command(ev.RESUME).tick()
    assert (docking.state, len(docking.calls())) == (State.DOCKING, calls + 1)
