"""The navigation kernel with a simulated drive in fake time."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2, wrap_angle
from robot_stack.core.goals import GoalStatus
from robot_stack.core.limits import SpeedLimit
from robot_stack.navigation.controller import Situation
from robot_stack.navigation.goal import GoalCode, GoalEnd
from robot_stack.navigation.pose_source import Located
from robot_stack.navigation.states import NavigationState
from tests.unit.navigation.plant import ROBOT, request, ride

GOAL = Pose2(5.0, 2.0, 1.0)


def assert_at(pose: Pose2, goal: Pose2) -> None:
    assert pose.distance_to(goal) < 0.05
    assert abs(wrap_angle(pose.yaw - goal.yaw)) < math.radians(2.0)


def test_reached_goal_is_reported_once() -> None:
    story = ride()
    output = story.tick()
    assert (output.twist, output.state) == (ZERO_TWIST, NavigationState.IDLE)
    assert story.go(GOAL) == ""
    path = story.controller.path
    assert path is not None
    assert path.end().distance_to(GOAL) < 1e-5
    story.run(1.0)
    story.go(GOAL)
    assert story.controller.path is path, "the same goal again"
    output = story.until_reached()
    assert_at(story.drive.pose, GOAL)
    assert output.text == "goal reached"
    assert story.controller.path is None
    story.run(1.0)
    assert_at(story.drive.pose, GOAL)
    assert sum(out.reached for out in story.outputs) == 1
    assert story.outputs[-1].twist == ZERO_TWIST
    assert max(story.errors_m) < 0.06


def test_goal_where_it_stands_is_reached_without_moving() -> None:
    story = ride(GOAL)
    story.go(GOAL)
    story.until_reached(1.0)
    assert all(output.twist == ZERO_TWIST for output in story.outputs)


def test_new_goal_while_driving_is_taken_over_without_a_jump() -> None:
    story = ride()
    story.go(Pose2(8.0, 0.0, 0.0))
    story.run(4.0)
    assert story.drive.twist.vx > 1.0
    story.go(Pose2(8.0, 5.0, 0.0))
    story.run(0.1)
    before, after = story.outputs[-3].twist, story.outputs[-1].twist
    assert math.hypot(after.vx - before.vx, after.vy - before.vy) < 0.15
    story.until_reached()
    assert_at(story.drive.pose, Pose2(8.0, 5.0, 0.0))
    assert sum(output.reached for output in story.outputs) == 1


def test_remaining_length_falls_to_zero() -> None:
    story = ride()
    assert story.controller.remaining_m == 0.0
    story.go(Pose2(8.0, 0.0, 0.0))
    left = [story.controller.remaining_m for _ in range(60) if story.tick()]
    assert left[0] == pytest.approx(8.0, abs=0.01)
    assert all(after <= before for before, after in pairwise(left))
    story.until_reached()
    assert story.controller.remaining_m == 0.0
    story.run(1.0)
    assert story.drive.pose.x < 8.02, "it does not swing past the goal"


def test_cancel_brakes_and_drops_the_goal() -> None:
    story = ride()
    story.go(Pose2(20.0, 0.0, 0.0))
    story.run(4.0)
    story.controller.cancel()
    assert story.controller.path is None
    assert story.tick().end == GoalEnd(GoalStatus.CANCELED, "goal cancelled")
    assert story.controller.state is NavigationState.BRAKING
    assert story.outputs[-1].twist.vx > 0.5  # a ramp, not a step
    story.run(3.0)
    assert story.controller.state is NavigationState.IDLE
    assert story.drive.twist.speed() < 1e-3
    assert story.controller.goal is None


@pytest.mark.parametrize(
    ("goal", "changes", "reason", "code"),
    [
        (Pose2(math.nan, 0.0, 0.0), {}, "position is not finite", GoalCode.INVALID),
        (Pose2(0.0, math.inf, 0.0), {}, "position is not finite", GoalCode.INVALID),
        (Pose2(0.0, 0.0, math.nan), {}, "orientation is not finite", GoalCode.INVALID),
        (Pose2(1.0, 0.0, 0.0), {"frame_id": "odom"}, "frame_id is 'odom', must be 'map'", GoalCode.TF_ERROR),
        (Pose2(1.0, 0.0, 0.0), {"frame_id": ""}, "frame_id is '', must be 'map'", GoalCode.TF_ERROR),
        (Pose2(600.0, 0.0, 0.0), {}, "limit 500.0 m", GoalCode.INVALID),
        (IDENTITY, {"quaternion": (0.0, 0.0, 0.0, 0.0)}, "squared norm is 0.000", GoalCode.INVALID),
        (IDENTITY, {"quaternion": (0.0, 0.0, 1.0, 1.0)}, "squared norm is 2.000", GoalCode.INVALID),
    ],
)
def test_refused_goal_ends_the_one_before(goal: Pose2, changes: dict[str, Any], reason: str, code: GoalCode) -> None:
    story = ride()
    story.go(GOAL)
    story.run(2.0)
    asked = replace(request(goal, story.now_s), **changes)
    assert reason in story.controller.request(asked, story.now_s, story.located())
    end = story.controller.take_end()
    assert end is not None
    assert (end.outcome, end.code) == (GoalStatus.ABORTED, code)
    assert reason in end.text
    assert story.tick().end is None, "an end is reported once"
    assert story.controller.goal is None
    story.run(3.0)
    assert story.drive.twist.speed() < 1e-3
    assert story.controller.state is NavigationState.IDLE


def test_emergency_stop_zeroes_at_once_and_only_a_new_goal_after_its_release_moves_the_robot() -> None:
    story = ride()
    story.go(Pose2(8.0, 0.0, 0.0))
    story.run(4.0)
    story.emergency_stop = True
    assert story.tick().twist == ZERO_TWIST
    assert story.controller.state is NavigationState.IDLE
    assert story.controller.goal is None
    text = "emergency stop: the goal is dropped"
    assert story.outputs[-1].text == text
    assert story.outputs[-1].end == GoalEnd(GoalStatus.ABORTED, text, GoalCode.STOPPED)
    assert story.go(Pose2(8.0, 0.0, 0.0)) == "an emergency stop is active: send the goal again after its release"
    story.run(3.0)
    stood_m = story.drive.pose.x
    story.emergency_stop = False
    story.run(3.0)
    assert all(output.twist == ZERO_TWIST for output in story.outputs[-120:])
    assert not story.go(Pose2(8.0, 0.0, 0.0))
    first = story.tick().twist
    assert first.speed() < 0.1  # starts from rest within the jerk limit
    commands = [story.tick().twist for _ in range(20)]
    # In 50 ms the planned 0.7 m/s2 adds 0.035 m/s, and the feedback a little more.
    for before, after in pairwise(commands):
        assert after.vx - before.vx <= 0.035 + 0.015
    story.until_reached()
    assert story.drive.pose.x > stood_m
    assert_at(story.drive.pose, Pose2(8.0, 0.0, 0.0))


def test_unknown_pose_holds_and_names_the_reason() -> None:
    story = ride()
    story.pose_known = False
    assert story.go(GOAL) == ""
    output = story.tick()
    assert (output.state, output.text) == (NavigationState.HELD, "/current_pose silent")
    assert story.controller.path is not None
    story.pose_known = True
    story.run(4.0)
    story.pose_known = False
    story.tick()
    story.pose_known = True
    for _ in range(5):
        output = story.tick()
        assert (output.state, output.twist) == (NavigationState.HELD, ZERO_TWIST), "it still rolls"
    story.until_reached()
    story.pose_known = False
    story.go(Pose2(900.0, 0.0, 0.0))
    story.pose_known = True
    output = story.tick()
    assert (output.state, output.twist) == (NavigationState.IDLE, ZERO_TWIST)
    assert "limit 500.0 m" in output.text


def test_speed_limits_while_driving() -> None:
    """A lower one slows without a jump and keeps the path; one of zero or of nonsense is a stop."""
    story = ride()
    story.go(Pose2(14.0, 0.0, 0.0))
    story.run(4.0)
    path = story.controller.path
    story.controller.set_speed_limit(SpeedLimit(0.5, 1.0))
    story.run(3.0)
    assert story.controller.path is path
    assert 0.47 < story.drive.twist.speed() <= 0.5 + 1e-6  # it may still be catching up
    assert max(story.errors_m) < 0.25
    for bad in (0.0, math.nan, -1.0):
        for limit in (SpeedLimit(bad, 1.0), SpeedLimit(1.0, bad)):
            story.controller.set_speed_limit(limit)
            assert story.tick().twist == ZERO_TWIST
    story.run(3.0)
    story.controller.set_speed_limit(SpeedLimit(0.3, 1.0))
    count = len(story.outputs)
    story.until_reached()
    assert max(output.twist.speed() for output in story.outputs[count:]) <= 0.3 + 1e-9
    assert_at(story.drive.pose, Pose2(14.0, 0.0, 0.0))


def test_the_limit_of_the_way_holds_beside_that_of_safety_and_is_approached_on_a_ramp() -> None:
    story = ride()
    story.go(Pose2(14.0, 0.0, 0.0))
    story.run(4.0)
    story.controller.set_way_limit(SpeedLimit(0.5, 1.0))
    before = len(story.outputs)
    story.run(3.0)
    speeds = [output.twist.speed() for output in story.outputs[before - 1 :]]
    assert max(a - b for a, b in pairwise(speeds)) < 0.1
    assert 0.4 < speeds[-1] <= 0.5
    story.controller.set_speed_limit(SpeedLimit(0.3, 1.0))
    story.run(2.0)
    assert story.drive.twist.speed() <= 0.3
    story.controller.set_speed_limit(SpeedLimit(1.0, 1.0))
    story.run(2.0)
    assert 0.4 < story.drive.twist.speed() <= 0.5


def test_robot_displaced_from_its_path_replans() -> None:
    story = ride()
    story.go(Pose2(8.0, 0.0, 0.0))
    story.run(3.0)
    pose = story.drive.pose
    story.drive.pose = Pose2(pose.x, pose.y + 0.6, pose.yaw)
    before = story.controller.path
    story.run(0.1)
    assert story.controller.path is not before
    story.until_reached()
    assert_at(story.drive.pose, Pose2(8.0, 0.0, 0.0))


def test_held_back_drive_does_not_wind_up() -> None:
    story = ride()
    story.go(Pose2(8.0, 0.0, 0.0))
    story.run(2.0)
    story.drive.blocked = True
    story.run(8.0)
    # The plan waits 0.10 m ahead of the robot, so the command is only the feedback on this error.
    assert story.outputs[-1].error.distance_m() <= 0.101
    assert story.outputs[-1].twist.speed() <= 1.5 * 0.101
    story.drive.blocked = False
    story.until_reached()


@pytest.mark.parametrize("held_from_s", [0.0, 4.0], ids=["from rest", "while driving"])
def test_goal_of_a_robot_that_does_not_follow_its_commands_ends(held_from_s: float) -> None:
    story = ride()
    story.go(Pose2(8.0, 0.0, 0.0))
    story.run(held_from_s)
    story.drive.blocked = True
    story.run(8.0)
    story.controller.set_speed_limit(SpeedLimit(0.0, 0.0))
    story.run(20.0)
    assert story.outputs[-1].state is NavigationState.HELD, "a stop is no lack of progress"
    story.controller.set_speed_limit(SpeedLimit(math.inf, math.inf))
    story.controller.cancel()
    story.go(Pose2(8.0, 0.0, 0.0))  # as a client that warns first
    story.run(9.0)
    ends = [output.end for output in story.outputs if output.end is not None and output.end.aborted]
    assert [end.code for end in ends] == [GoalCode.FAILED_TO_MAKE_PROGRESS]
    assert (story.outputs[-1].state, story.outputs[-1].twist) == (NavigationState.IDLE, ZERO_TWIST)
    story.drive.blocked = False
    story.go(Pose2(8.0, 0.0, 0.0))
    story.until_reached()


def test_goal_of_a_robot_that_a_person_holds_by_hand_control_continues() -> None:
    story = ride()
    story.go(Pose2(8.0, 0.0, 0.0))
    story.run(4.0)
    story.drive.blocked = story.manual = True
    story.run(30.0)
    assert all(output.end is None for output in story.outputs)
    story.manual = False
    story.run(11.0)
    assert all(output.end is None for output in story.outputs), "the time held does not count afterwards"
    story.drive.blocked = False
    story.until_reached()


def test_cancelled_goal_of_a_robot_that_is_held_back_leaves_no_command() -> None:
    story = ride()
    story.go(Pose2(8.0, 0.0, 0.0))
    story.run(4.0)
    story.drive.blocked = True
    story.run(2.0)
    story.controller.cancel()
    assert story.tick().twist.speed() <= 0.16, "not the speed at which the plan waits"
    story.run(3.0)
    assert (story.outputs[-1].state, story.outputs[-1].twist) == (NavigationState.IDLE, ZERO_TWIST)


def test_plan_begins_when_the_robot_does() -> None:
    story = ride()
    story.drive.blocked = True  # as while the wheels steer
    story.go(Pose2(4.0, 0.0, 0.0))
    story.run(0.5)
    assert 0.0 < story.outputs[-1].twist.vx < 0.03
    assert story.outputs[-1].planned == IDENTITY
    story.drive.blocked = False
    story.run(1.0)
    assert max(story.errors_m) < 0.04  # the drive lags by 0.1 s, of which 0.02 s are expected
    story.until_reached()
    story.drive.blocked = True
    story.go(Pose2(8.0, 0.0, 0.0))
    story.run(3.0)
    assert story.outputs[-1].twist.vx > 0.1, "it is pushed after a while"


def test_clock_jump_causes_no_motion() -> None:
    story = ride()
    story.go(Pose2(8.0, 0.0, 0.0))
    story.run(2.0)
    planned = story.outputs[-1].planned
    story.now_s += 3600.0
    after = story.tick().planned
    assert planned is not None
    assert after is not None
    assert after.distance_to(planned) < 1.5 * 0.2 + 1e-6
    story.now_s -= 7200.0
    story.tick()
    story.until_reached()
    assert_at(story.drive.pose, Pose2(8.0, 0.0, 0.0))


def test_not_finite_pose_never_leaves_as_a_command() -> None:
    story = ride()
    story.go(GOAL)
    story.run(1.0)
    broken = Located(Pose2(math.nan, 0.0, 0.0), ZERO_TWIST)
    assert story.controller.tick(Situation(story.now_s, broken)).twist == ZERO_TWIST


def test_goal_from_a_moving_robot_without_a_plan_starts_from_its_motion() -> None:
    story = ride()
    story.drive.twist = Twist2(0.8, 0.0, 0.0)  # driven by another source
    story.go(Pose2(5.0, 0.0, 0.0))
    first = story.tick().twist
    assert first.vx == pytest.approx(0.8, abs=0.2)
    story.until_reached()


poses = st.builds(Pose2, st.floats(-6.0, 6.0), st.floats(-6.0, 6.0), st.floats(-math.pi, math.pi))


@given(poses, poses, st.booleans(), st.floats(0.02, 0.1), st.floats(0.0, 0.06))
@settings(max_examples=12, deadline=None)
def test_every_goal_is_reached_from_everywhere(
    start: Pose2, goal: Pose2, passenger: bool, delay_s: float, lag_s: float
) -> None:
    story = ride(start)
    story.controller.set_passenger(passenger)
    story.drive.motion = ROBOT.motion(passenger)
    story.drive.delay_s, story.drive.lag_s = delay_s, lag_s
    story.go(goal)
    story.until_reached()
    assert_at(story.drive.pose, goal)
    limit = ROBOT.motion(passenger)
    for output in story.outputs:
        assert output.twist.speed() <= limit.max_speed_mps + 1e-9
        assert abs(output.twist.omega) <= limit.max_yaw_rate_radps + 1e-9


events = st.sampled_from(
    (
        *("goal", "cancel", "bad goal", "emergency", "between ticks", "release", "lose pose", "find pose"),
        *("stop", "limit", "free", "passenger"),
    )
)


@given(st.lists(st.tuples(events, poses), max_size=15))
@settings(max_examples=25, deadline=None)
def test_commands_stay_finite_and_are_zero_if_motion_is_forbidden(steps: list[tuple[str, Pose2]]) -> None:
    story = ride()
    passenger = False
    for event, pose in steps:
        if event == "goal":
            story.go(pose)
        elif event == "cancel":
            story.controller.cancel()
        elif event == "bad goal":
            assert story.go(Pose2(math.nan, 0.0, 0.0))
        elif event == "between ticks":
            story.controller.stop()
            assert (story.controller.state, story.controller.goal) == (NavigationState.IDLE, None)
        elif event in ("emergency", "release"):
            story.emergency_stop = event == "emergency"
        elif event in ("lose pose", "find pose"):
            story.pose_known = event == "find pose"
        elif event in ("stop", "limit", "free"):
            speed = {"stop": 0.0, "limit": 0.4, "free": math.inf}[event]
            story.controller.set_speed_limit(SpeedLimit(speed, speed))
        else:
            passenger = not passenger
            story.controller.set_passenger(passenger)
        for _ in range(8):
            output = story.tick()
            assert output.twist.is_finite()
            at_rest = output.state in (NavigationState.IDLE, NavigationState.HELD)
            if story.emergency_stop or not story.pose_known or at_rest:
                assert output.twist == ZERO_TWIST


def test_old_goal_is_refused_and_one_without_stamp_is_not() -> None:
    story = ride()
    assert "stamp is 10.0 s old, limit 5.0 s" in story.controller.request(
        request(GOAL, story.now_s - 10.0), story.now_s, story.located()
    )
    assert story.controller.request(request(GOAL, 0.0), story.now_s, story.located()) == ""
