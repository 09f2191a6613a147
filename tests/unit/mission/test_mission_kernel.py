"""Every transition of the mission manager, tick by tick in fake time."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from robot_stack.contract.display import Display
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.goals import GoalStatus, NavigationEnded
from robot_stack.core.mission import Mission
from robot_stack.mission import diagram
from robot_stack.mission import events as ev
from robot_stack.mission.kernel import MissionKernel
from robot_stack.mission.record import HOME_NAME, Record
from robot_stack.mission.states import ACTIVE, TRANSITIONS, State, Trigger, target_of

from .conftest import DEPARTURE, STILL, TICK_S, Story, make_mission

WAIT_2S = {"wait": 2.0}


# --- the ride --------------------------------------------------------------------------------------------------------


def test_comes_up_idle_and_silent(story):
    assert story.state is State.IDLE
    story.tick(5.0)
    assert story.log == []
    assert story.journal.records == []
    assert story.status.state == "IDLE"
    assert story.status.last_command == ""
    assert not story.status.last_command_accepted


def test_start_journals_before_the_goal_leaves(story):
    order: list[str] = []
    story.journal.save = lambda record: order.append(record.state.value)
    story.send_goal = lambda goal: order.append(f"goal {goal.pose.x}")
    story.start("park")
    assert order == ["RUNNING", "goal 2.0"]


def test_mission_passes_waits_and_parks_until_completed(story):
    story.start("pass", WAIT_2S, "park")
    story.at(1.6, speed=1.0).tick()  # passes within 0.5 m of w0 (x = 2) without stopping
    assert story.goals() == [2.0, 4.0]
    story.reach(4.0)
    assert story.state is State.WAITING
    assert story.status.current_waypoint == "w1"
    story.tick(1.7)
    assert story.state is State.WAITING
    story.tick(0.5)
    assert story.goals() == [2.0, 4.0, 6.0]
    assert story.state is State.RUNNING
    story.reach(6.0)
    assert story.state is State.COMPLETED
    assert story.goal is None, "the navigation controller is left without a goal"
    assert (story.status.progress, story.status.waypoints_completed, story.status.reason) == (1.0, 3, "")


@pytest.mark.parametrize(
    ("x", "yaw", "twist", "reached"),
    [
        (2.049, 0.0, STILL, True),
        (2.051, 0.0, STILL, False),
        (2.0, math.radians(1.9), STILL, True),
        (2.0, math.radians(-2.1), STILL, False),
        (2.0, 2.0 * math.pi, STILL, True),  # the same heading
        (2.0, 0.0, Twist2(0.03, 0.0, 0.0), False),
        (2.0, 0.0, Twist2(0.0, 0.0, 0.1), False),
        (2.0, 0.0, Twist2(math.nan, 0.0, 0.0), False),
        (2.0, 0.0, None, False),
    ],
)
def test_the_end_is_reached_exactly_and_standing(story, x, yaw, twist, reached):
    # The last waypoint must be reached exactly, even if its action is pass.
    story.start("pass").at(x, 0.0, yaw).given(twist=twist).tick(1.0)
    assert (story.state is State.COMPLETED) == reached


def test_standing_for_a_moment_while_sliding_through_is_not_arrival(story):
    story.start("park")
    for _ in range(5):  # never for settle_s without interruption
        story.at(2.0).tick(0.2).at(2.0, speed=0.2).tick()
    assert story.state is State.RUNNING


def test_pass_waypoint_requires_approximate_heading(story):
    story.start("pass", "park").at(2.0, yaw=1.0, speed=1.0).tick()
    assert story.goals() == [2.0]
    story.at(2.0, yaw=0.5, speed=1.0).tick()
    assert story.goals() == [2.0, 4.0]


# --- commands --------------------------------------------------------------------------------------------------------


def test_pause_takes_the_goal_away_and_resume_goes_to_the_same_waypoint(story):
    story.start("pass", "park").at(2.0, speed=1.0).tick().at(3.0).clear()
    story.command(ev.PAUSE)
    assert (story.state, story.goal, story.log) == (State.PAUSED, None, ["cancel all"])
    story.tick(60.0)
    assert story.goals() == []
    assert story.status.reason == "paused by command; RESUME goes on"
    story.given(battery=0.2).command(ev.RESUME)  # a low battery forbids new missions only
    assert story.goals() == [4.0]
    assert story.status.current_waypoint == "w1"
    assert story.status.reason == ""


def test_the_stop_of_a_pause_does_not_wait_for_the_journal(story):
    story.start("park")
    order: list[str] = []
    story.journal.save = lambda record: order.append(record.state.value)
    story.cancel_goal = lambda everything: order.append("cancel")
    story.command(ev.PAUSE)
    assert order == ["cancel", "PAUSED"]


def test_pause_while_waiting_begins_the_wait_again(story):
    story.start(WAIT_2S, "park").reach(2.0).tick(1.0).command(ev.PAUSE)
    assert story.state is State.PAUSED
    story.command(ev.RESUME)
    assert story.goals() == [2.0, 2.0]
    story.reach(2.0)
    assert story.state is State.WAITING
    story.tick(1.5)
    assert story.state is State.WAITING


@pytest.mark.parametrize("prepare", [(), (ev.PAUSE,)])
def test_abort_ends_the_mission_and_keeps_the_passenger(story, prepare):
    story.happens(ev.PassengerChanged(True)).start("park")
    for command in prepare:
        story.command(command)
    story.command(ev.ABORT)
    assert (story.state, story.goal) == (State.ABORTED, None)
    assert story.status.passenger_attached
    assert story.status.reason == "aborted by command; the passenger stays attached until an operator decides"


REFUSED_WITHOUT_A_MISSION = (ev.PAUSE, ev.RESUME, ev.ABORT)


@pytest.mark.parametrize("command", REFUSED_WITHOUT_A_MISSION)
def test_commands_without_a_mission_are_refused(story, command):
    story.command(command)
    assert story.state is State.IDLE
    assert story.log == []
    assert (story.status.last_command, story.status.last_command_accepted) == (command, False)
    assert story.status.reason.startswith(f"{command} refused: ")
    assert "IDLE" in story.status.reason


def test_a_refusal_stays_visible_until_the_next_command(story):
    story.start("park").command(ev.RESUME)
    story.tick(3.0)
    assert story.status.reason == "RESUME refused: RESUME needs a paused mission, the state is RUNNING"
    story.command(ev.PAUSE)
    assert "refused" not in story.status.reason


def test_start_of_the_active_mission_is_refused(story):
    """A second touch of the button is not a second ride."""
    story.start("park", "park").clear()
    for prepare in (None, ev.PAUSE):
        if prepare:
            story.command(prepare).clear()
        story.command(ev.START_MISSION, make_mission("park"))
        assert story.waiting() == []
        assert story.goals() == []
        assert "mission 'ride' is" in story.status.reason
        assert not story.status.last_command_accepted


def test_unknown_command_or_mission_is_refused_with_the_known_ones(story):
    story.command(ev.START_MISSION, None, "there is no mission 'x'; known: ride")
    assert story.status.reason == "START_MISSION refused: there is no mission 'x'; known: ride"
    story.command("FLY")
    known = "START_MISSION, PAUSE, RESUME, ABORT, EMERGENCY_STOP"
    assert story.status.reason == f"FLY refused: unknown command; known: {known}"
    assert (story.state, story.log) == (State.IDLE, [])
    story.command("x" * 10_000)
    assert len(story.status.last_command) == 64


@pytest.mark.parametrize(
    ("inputs", "why"),
    [
        ({"battery": 0.29}, "battery at 29%, a new mission needs 30%"),
        ({"faults": ("BATTERY_LOW",)}, "BATTERY_LOW is active"),
        ({"faults": ("BATTERY_CRITICAL",)}, "BATTERY_CRITICAL is active"),
        ({"emergency_stop": True}, "emergency stop is active"),
    ],
)
def test_unmet_precondition_rejects_start(story, inputs, why):
    story.given(**inputs).start("park")
    assert story.state is State.IDLE
    assert story.log == []
    assert why in story.status.reason


def test_an_unknown_charge_does_not_forbid_a_start(story):
    story.given(battery=math.nan).start("park")
    assert story.state is State.RUNNING


# --- emergency stop --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("prepare", ["running", "waiting", "paused"])
def test_emergency_stop_until_release_and_resume(story, prepare):
    story.start(WAIT_2S, "park")
    if prepare == "waiting":
        story.reach(2.0)
    if prepare == "paused":
        story.command(ev.PAUSE)
    story.clear().emergency(True)
    assert (story.state, story.goal, story.log) == (State.STOPPED, None, ["cancel all"])
    assert story.status.state == "PAUSED"
    assert story.status.reason.startswith("emergency stop")
    assert story.status.display == Display.EMERGENCY_STOP
    story.tick(5.0).command(ev.RESUME)
    assert story.state is State.STOPPED
    assert "release it and reset the safety monitor first" in story.status.reason
    story.emergency(False).tick(30.0)
    assert (story.state, story.log) == (State.STOPPED, ["cancel all"]), "release alone moves nothing"
    assert story.status.display == Display.PAUSED
    story.command(ev.RESUME)
    assert story.state is State.RUNNING
    assert story.goals() == [2.0]


def test_emergency_stop_seen_only_by_the_tick(story):
    story.start("park").given(emergency_stop=True).tick()
    assert story.state is State.STOPPED
    assert story.goal is None


def test_the_emergency_stop_command_works_with_a_full_disk(story):
    story.start("park").clear()
    story.journal.problem = "full"
    story.command(ev.EMERGENCY_STOP)
    assert story.log == [("emergency_stop", True), "cancel all"]
    assert story.state is State.STOPPED
    assert story.status.last_command_accepted
    assert "the journal cannot be written: full" in story.status.reason


def test_nothing_goes_between_our_stop_and_its_echo(story):
    story.start("park").command(ev.EMERGENCY_STOP).clear()
    story.command(ev.RESUME).tick(1.0).command(ev.RESUME)  # inputs.emergency_stop is still false
    assert story.state is State.STOPPED
    assert story.log == []


def test_our_own_stop_is_taken_back_after_the_release_only(story):
    story.command(ev.EMERGENCY_STOP).emergency(True).tick(3.0)
    assert story.log == [("emergency_stop", True)]
    story.emergency(False)
    assert story.log == [("emergency_stop", True), ("emergency_stop", False)]
    story.tick(3.0)
    assert len(story.log) == 2


# --- tries -----------------------------------------------------------------------------------------------------------


def test_three_tries_then_failed(story):
    story.start("pass", "park").at(0.3).clear()
    for attempt in (1, 2):
        story.stall()
        assert story.state is State.RUNNING
        assert f"try {attempt} of 3" in story.status.reason
        assert "'w0'" in story.status.reason
    story.stall()
    assert story.state is State.FAILED
    assert story.goal is None
    assert (
        story.status.reason
        == f"no progress for {story.params.progress_timeout_s:.0f} s, 1.70 m before waypoint 'w0', try 3 of 3"
    )
    assert story.status.display == Display.ERROR


def test_a_try_takes_the_goal_away_before_it_gives_it_again(story):
    story.start("park").at(0.3).stall().clear()
    story.tick(2 * TICK_S)
    assert story.log == [("goal", Pose2(2.0, 0.0, 0.0))]
    story.clear().stall()
    assert story.log[-1] == "cancel"


def test_slow_progress_is_progress(story):
    story.start("park")
    for step in range(300):  # 10 mm/s for 30 s
        story.at(0.001 * step, speed=0.01).tick()
    assert story.kernel.record.failed_tries == 0


def test_a_way_around_is_progress(story):
    """A plan of 8 m leads away from the goal and back; the straight-line distance grows for the first half."""
    story.start("park").at(0.0)
    for step in range(400):  # 0.1 m/s for 40 s
        away_m = 0.01 * min(step, 400 - step)
        story.at(-away_m, speed=0.1).drives(10.0 - 0.01 * step).tick()
    assert story.kernel.record.failed_tries == 0


def test_alternating_plans_count_as_no_progress(story):
    story.start("park").at(0.3)
    for step in range(round((story.params.progress_timeout_s + 2.0 * DEPARTURE.warning_s + 1.0) / TICK_S)):
        story.drives(4.7 if step % 20 < 10 else 1.7).tick()
    assert story.kernel.record.failed_tries == 1


def test_turning_is_progress(story):
    story.start("park")
    for step in range(300):
        story.at(1.9, yaw=3.0 - 0.01 * step).tick()
    assert story.kernel.record.failed_tries == 0


@pytest.mark.parametrize(
    "hindrance",
    [
        {"pose": None},
        {"pose": Pose2(math.nan, 0.0, 0.0)},
        {"safety_known": False},
        {"faults": ("COLLISION_IMMINENT",)},
        {"faults": ("LIDAR_TIMEOUT", "IMU_TIMEOUT")},
    ],
)
def test_a_robot_that_may_not_move_fails_no_try(story, hindrance):
    story.start("park").at(0.3).given(**hindrance).tick(10 * story.params.progress_timeout_s)
    assert story.state is State.RUNNING
    assert story.kernel.record.failed_tries == 0
    assert story.status.reason.startswith(("waiting for pose", "held"))
    story.given(pose=Pose2(0.3, 0.0, 0.0), safety_known=True, faults=()).departs()
    assert story.status.reason == ""


def test_a_speed_limit_does_not_excuse_a_try(story):
    story.start("park").at(0.3).given(faults=("IMU_TIMEOUT",)).stall()
    assert story.kernel.record.failed_tries == 1


def test_tries_begin_afresh_at_the_next_waypoint_and_after_resume(story):
    story.start("pass", "park").at(0.3).stall()
    assert story.kernel.record.failed_tries == 1
    story.command(ev.PAUSE).command(ev.RESUME)
    assert story.kernel.record.failed_tries == 0
    story.stall().tick().at(2.0, speed=1.0).tick()
    assert (story.kernel.record.waypoint, story.kernel.record.failed_tries) == (1, 0)


# --- navigation controller -------------------------------------------------------------------------------------------


ENDS = {
    "aborted": (GoalStatus.ABORTED, 208, "no path"),
    "preempted": (GoalStatus.ABORTED, 0, "preempted by a newer goal"),
    "rejected": (GoalStatus.REJECTED,),
    "cancelled by another client": (GoalStatus.CANCELED,),
    "reached, but not the waypoint": (GoalStatus.SUCCEEDED,),
}


@pytest.mark.parametrize("end", ENDS.values(), ids=ENDS)
def test_a_goal_that_ends_before_the_waypoint_is_sent_again_after_a_pause(story, end):
    story.start("park").clear().happens(NavigationEnded(story.goal_call, *end)).tick(1.8)
    assert story.goals() == []
    story.tick(0.3)
    assert story.goals() == [2.0]
    story.tick(5.0)
    assert story.goals() == [2.0], "once for each end"


def test_a_docking_by_another_client_holds_the_ride_and_keeps_its_goal(story):
    story.start("park").at(0.3).given(docking_state="APPROACH").clear()
    story.aborts(0, "preempted by a newer goal").tick(60.0)
    assert story.log == []
    assert story.kernel.record.failed_tries == 0
    assert story.status.reason == "held: docking_controller executes a goal of another client"
    story.given(docking_state="DOCKED").tick(DEPARTURE.warning_s + 2 * TICK_S)
    assert story.goals() == [2.0]


def test_aborted_goals_fail_the_try_by_the_progress_alone(story):
    """A refusal may pass, as one while the controller still has the emergency stop."""
    story.start("park").at(0.3)
    begun_s = story.now_s
    while story.kernel.record.failed_tries == 0:
        story.aborts(208, "goal refused: no path").tick(2.2)
    assert story.now_s - begun_s == pytest.approx(story.params.progress_timeout_s + 2.0 * DEPARTURE.warning_s, abs=2.3)
    while story.state is State.RUNNING:
        story.aborts(208, "goal refused: no path").tick(2.2)
    assert story.state is State.FAILED
    assert story.status.reason.endswith("try 3 of 3; navigation: goal refused: no path (error 208)")


def test_the_reason_of_an_earlier_goal_is_not_shown(story):
    story.start("park").at(0.3).aborts(104, "gave up").tick(3.0).stall()
    assert "navigation" not in story.status.reason


@pytest.mark.parametrize("end", ENDS.values(), ids=ENDS)
def test_events_of_an_earlier_goal_are_ignored(story, end):
    story.start("pass", "park")
    call = story.goal_call
    story.at(1.7).tick().clear().happens(NavigationEnded(call, *end))
    story.happens(NavigationEnded(call, GoalStatus.UNKNOWN)).tick(5.0)
    assert story.goals() == []


def test_a_lost_goal_is_sent_again_at_once(story):
    """The navigation controller has restarted."""
    story.start("park").tick(1.0).clear().loses_goal().tick()
    assert story.goals() == [2.0]


def test_without_a_navigation_controller_the_tries_fail(story):
    story.start("park").at(0.3).given(navigation_served=False).loses_goal().clear()
    story.tick()
    assert story.status.reason == "waiting for navigation_controller"
    begun_s = story.now_s
    while story.state is State.RUNNING:
        story.tick()
    assert story.state is State.FAILED
    assert story.goals() == []
    assert story.status.reason.endswith("try 3 of 3; navigation: no navigation_controller")
    assert story.now_s - begun_s == pytest.approx(3.0 * story.params.progress_timeout_s, abs=1.0)


def test_a_waypoint_is_reached_without_a_navigation_controller(story):
    """It ended after it had driven the robot there."""
    story.start("park").at(1.9, speed=0.1).tick().given(navigation_served=False)
    story.loses_goal().reach(2.0)
    assert story.state is State.COMPLETED


def test_while_paused_a_goal_of_navigation_is_cancelled_until_it_is_gone(story):
    story.start("park").command(ev.PAUSE).given(planned=True).clear().tick(4.5)
    assert story.log == ["cancel all", "cancel all"]
    story.given(planned=False).clear().tick(10.0)
    assert story.log == []


# --- status ----------------------------------------------------------------------------------------------------------


def test_status_once_a_second_while_active_and_silence_otherwise(story):
    story.clear().tick(10.0)
    assert story.statuses == []
    story.start("park").clear().tick(10.0)
    assert 9 <= len(story.statuses) <= 11
    story.command(ev.PAUSE).clear().tick(10.0)
    assert 9 <= len(story.statuses) <= 11
    story.command(ev.ABORT).clear().tick(10.0)
    assert story.statuses == []


def test_progress_is_by_length(story):
    # Start at 0, waypoints at 2, 4 and 6 m: half is done at 3 m.
    story.start("pass", "pass", "park").at(2.0, speed=1.0).tick().at(3.0, speed=1.0).tick(1.1)
    assert story.status.progress == pytest.approx(0.5)
    assert story.status.waypoints_completed == 1


def test_progress_without_a_pose_counts_waypoints(story):
    story.given(pose=None).start("pass", "park")
    assert story.status.progress == 0.0
    story.at(2.0, speed=1.0).tick().tick().given(pose=None).tick(1.1)
    assert story.status.progress == 0.5


def test_eta_is_length_over_speed_plus_the_waits(story):
    story.start("pass", {"wait": 7.0}, "park")
    for _ in range(300):
        story.at(1.0, speed=0.5).tick()
        if story.kernel.record.failed_tries:
            break
    # 5 m left at 0.5 m/s, plus 7 s of waiting.
    assert story.status.eta_s == pytest.approx(17.0, abs=0.01)


def test_eta_is_unknown_at_rest_and_while_held(story):
    story.start("park").tick(1.1)
    assert math.isnan(story.status.eta_s)
    story.at(1.0, speed=0.5).tick(2.0)
    assert story.status.eta_s == pytest.approx(2.0)
    story.given(faults=("COLLISION_IMMINENT",)).tick(1.1)
    assert math.isnan(story.status.eta_s)
    story.given(faults=()).command(ev.PAUSE)
    assert math.isnan(story.status.eta_s)


def test_eta_counts_a_wait_down(story):
    story.start({"wait": 10.0}).at(1.0, speed=0.5).tick(1.0).reach(2.0).tick(4.0)
    assert story.state is State.WAITING
    assert story.status.eta_s == pytest.approx(6.0, abs=1.2)


@pytest.mark.parametrize(
    ("inputs", "display"),
    [
        ({}, Display.NAVIGATING),
        ({"pose": None}, Display.LOCALIZATION_LOST),
        ({"faults": ("LOCALIZATION_LOST",)}, Display.LOCALIZATION_LOST),
        ({"faults": ("OBSTACLE_NEAR",)}, Display.OBSTACLE),
        ({"faults": ("OBSTACLE_NEAR",), "twist": Twist2(0.3, 0.0, 0.0)}, Display.NAVIGATING),  # slower, but it drives
        ({"faults": ("COLLISION_IMMINENT",), "twist": Twist2(0.3, 0.0, 0.0)}, Display.OBSTACLE),  # stopped by it
        ({"faults": ("LIDAR_TIMEOUT",)}, Display.ERROR),
        ({"faults": ("IMU_TIMEOUT",)}, Display.NAVIGATING),  # slower, but it drives
        ({"safety_known": False}, Display.ERROR),
        ({"manual": True}, Display.MANUAL),
        ({"charging": True}, Display.NAVIGATING),
    ],
)
def test_display_under_way(story, inputs, display):
    story.start("park").at(1.0).given(**inputs).tick()
    assert story.status.display == display


def test_display_at_rest(story):
    assert story.status.display == Display.IDLE
    story.given(battery=0.1).tick()
    assert story.status.display == Display.LOW_BATTERY
    story.given(charging=True).tick()
    assert story.status.display == Display.CHARGING
    story.happens(ev.PassengerChanged(True))
    assert story.status.display == Display.PASSENGER_ONBOARD, "who carries somebody says that first"


def test_the_display_is_dark_until_anything_is_known(params):
    story = Story(params)
    blind = replace(story.inputs, pose=None, safety_known=False)
    kernel = MissionKernel(params, DEPARTURE)
    report, _queue = kernel.start_up(blind)
    assert report.status.display == Display.OFF
    assert kernel.step(ev.Tick(), blind, 1.0) == ()
    (report,) = kernel.step(ev.Tick(), story.inputs, 2.0)
    assert report.status.display == Display.IDLE
    (report,) = kernel.step(ev.EmergencyStopBegan(), replace(blind, emergency_stop=True), 3.0)
    assert report.status.display == Display.EMERGENCY_STOP
    (report,) = kernel.step(ev.Tick(), blind, 4.0)
    assert report.status.display == Display.IDLE, "it has been ready; what is wrong now the safety monitor says"


@pytest.mark.parametrize(
    ("aboard", "charging", "display"),
    [
        (False, False, Display.PAUSED),
        (True, False, Display.PASSENGER_ONBOARD),
        (False, True, Display.CHARGING),
    ],
)
def test_a_robot_that_waits_does_not_show_that_it_drives(story, aboard, charging, display):
    story.happens(ev.PassengerChanged(aboard)).start({"wait": 30.0}, "park").reach(2.0)
    assert story.state is State.WAITING
    assert story.given(charging=charging).tick().status.display == display


# --- home on a low battery -------------------------------------------------------------------------------------------


def test_a_battery_that_runs_low_sends_the_robot_home(story):
    story.start("park").given(battery=0.25).reach(2.0)
    assert (story.state, story.status.current_waypoint, story.status.total_waypoints) == (State.RUNNING, HOME_NAME, 2)
    assert story.goals()[-1] == 0.0
    story.reach(0.0)
    assert story.state is State.COMPLETED
    assert story.status.waypoints_completed == 2


def test_not_with_a_passenger(story):
    story.happens(ev.PassengerChanged(True)).start("park").given(battery=0.25).reach(2.0)
    assert story.state is State.COMPLETED


def test_not_if_the_route_ends_at_home(params):
    story = Story(params)
    story.command(ev.START_MISSION, make_mission("park", home=(2.2, 0.0, 0.0))).given(battery=0.25).reach(2.0)
    assert story.state is State.COMPLETED


# --- journal ---------------------------------------------------------------------------------------------------------


def test_an_unwritable_journal_pauses_a_ride(story):
    story.start("pass", "park")
    story.journal.problem = "disk full"
    story.at(2.0, speed=1.0).tick()
    assert story.state is State.PAUSED
    assert story.goal is None
    assert story.goals() == [2.0]
    resume = "paused; RESUME goes on once the journal can be written"
    assert story.status.reason == f"{resume}; the journal cannot be written: disk full"
    assert story.kernel.record.waypoint == 1


def test_the_journal_is_written_again_when_the_disk_recovers(story):
    story.start("park")
    story.journal.problem = "disk full"
    story.command(ev.PAUSE).tick(5.0)
    assert story.state is State.PAUSED
    assert story.status.last_command_accepted
    assert "the journal cannot be written: disk full" in story.status.reason
    assert story.journal.records[-1].state is State.RUNNING
    story.journal.problem = ""
    story.tick(2.0)
    assert story.journal.records[-1].state is State.PAUSED
    assert "journal" not in story.status.reason
    story.command(ev.RESUME)
    assert story.state is State.RUNNING


def test_a_refused_start_forgets_no_passenger(story):
    story.journal.problem = "disk full"
    story.happens(ev.PassengerChanged(True)).start("park")
    assert (story.state, story.log, story.kernel.record.passenger_attached) == (State.IDLE, [], True)
    assert story.status.reason.startswith("START_MISSION refused: the journal cannot be written: disk full")


# --- restart ---------------------------------------------------------------------------------------------------------


def journaled(state: State, mission: Mission | None = None, **fields) -> Record:
    return Record(state, mission or make_mission("pass", "park"), **fields)


@pytest.mark.parametrize("state", sorted(ACTIVE, key=lambda state: state.value))
def test_a_restart_comes_up_paused_with_everything_as_it_was(params, state):
    actions = {State.DOCKING: {"dock": "chair_1"}, State.UNDOCKING: "undock"}
    mission = make_mission("pass", actions.get(state, "park"))
    story = Story(params, journaled(state, mission, waypoint=1, passenger_attached=True))
    assert story.state is State.PAUSED
    assert story.log == ["cancel all", "cancel all docking"], (
        "a navigation controller may still be driving for the one that died"
    )
    status = story.status
    assert (status.state, status.mission.id) == ("PAUSED", "ride")
    assert (status.current_waypoint, status.waypoints_completed) == ("w1", 1)
    assert status.passenger_attached
    assert f"restarted while {state.value}" in status.reason
    assert story.journal.records[-1].state is State.PAUSED
    story.tick(60.0)
    assert story.goals() == []
    story.command(ev.RESUME)
    assert story.goals() == [4.0]


@pytest.mark.parametrize("state", [State.COMPLETED, State.ABORTED, State.FAILED, State.IDLE])
def test_a_mission_that_ended_does_not_come_back(params, state):
    story = Story(params, journaled(state, waypoint=2, passenger_attached=True))
    assert story.state is State.IDLE
    assert story.log == []
    assert story.status.mission is None
    assert story.status.passenger_attached
    story.command(ev.RESUME)
    assert story.state is State.IDLE


def test_damaged_journal_is_reported_until_next_start(params):
    story = Story(params, None, "the journal was damaged")
    assert story.state is State.IDLE
    assert story.status.reason == "the journal was damaged"
    assert story.log == ["cancel all", "cancel all docking"], "of a mission that may be under way"
    story.start("park")
    assert story.state is State.RUNNING
    assert story.status.reason == ""


# --- time ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("jump_s", [1e6, -1e6, math.nan])
def test_a_clock_that_jumps_ends_no_wait_and_fails_no_try(story, jump_s):
    story.start({"wait": 100.0}).at(0.3)
    story.now_s += jump_s
    story.tick()
    assert story.kernel.record.failed_tries == 0
    story.now_s = 5000.0
    story.reach(2.0)
    assert story.state is State.WAITING
    story.now_s += jump_s
    story.tick()
    assert story.state is State.WAITING


# --- the table -------------------------------------------------------------------------------------------------------


def test_every_state_can_be_left_and_every_trigger_is_used():
    assert {row.source for row in TRANSITIONS} == set(State)
    assert {row.trigger for row in TRANSITIONS} == set(Trigger)
    assert {row.target for row in TRANSITIONS} | {State.IDLE} == set(State)


def test_every_active_state_can_be_aborted_and_no_other():
    assert {state for state in State if target_of(state, Trigger.ABORT)} == set(ACTIVE)


def test_the_document_is_fresh():
    drawn = Path(__file__).parents[3] / "docs" / "mission_states.md"
    assert drawn.read_text(encoding="utf-8") == diagram.document(), "draw it again: its second line says how"


def test_a_door_that_does_not_open_neither_fails_the_mission_nor_ends_the_goal(story):
    story.start("park").at(0.3, speed=0.5).tick().clear()
    story.given(door="waiting for door hall").at(0.4).tick(3.0 * story.params.tries * story.params.progress_timeout_s)
    assert story.state is State.RUNNING
    assert story.kernel.record.failed_tries == 0
    assert story.status.reason == "waiting for door hall"
    story.given(door="").tick(5.0)
    assert story.log == [], "navigation warns people itself: it must keep its goal, with which its request ends"
    story.at(0.5, speed=0.5).tick().at(0.5).tick(DEPARTURE.after_s + 1.0)
    assert story.log == ["cancel"]
