"""Plans: limits kept at all times, the goal reached, velocity and acceleration continuous."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.core.geometry import IDENTITY, Pose2, Twist2, wrap_angle
from robot_stack.core.limits import MotionLimits
from robot_stack.navigation.limits import PlanningLimits
from robot_stack.navigation.motion import MotionState, Trajectory, moving
from robot_stack.navigation.plan import plan_motion, plan_stop
from robot_stack.navigation.speed_profile import AxisLimits, to_position, to_speed

LIMITS = MotionLimits(1.0, 1.0, 1.0, 1.0, 2.0, 2.0)
FREE_TURNING = 100.0


def plan(start: MotionState, goal: Pose2, limits: MotionLimits = LIMITS, turning: float = FREE_TURNING) -> Trajectory:
    return plan_motion(start, goal, PlanningLimits(limits, limits, turning))


STEP_S = 0.01


def states(trajectory: Trajectory) -> list[MotionState]:
    count = math.ceil(trajectory.duration_s / STEP_S)
    return [trajectory.at(STEP_S * i) for i in range(count + 2)]


def check_limits(trajectory: Trajectory, limits: MotionLimits, max_speed: float | None = None) -> None:
    """Checks speed and acceleration, and jerk and continuity over steps of 10 ms."""
    speed = limits.speed_mps if max_speed is None else max_speed
    for before, after in pairwise(states(trajectory)):
        assert before.is_finite()
        assert before.speed() <= speed + 1e-6
        assert math.hypot(*before.acceleration) <= limits.acceleration_mps2 + 1e-6
        jerk = math.dist(before.acceleration, after.acceleration) / STEP_S
        assert jerk <= limits.jerk_mps3 * 1.001 + 1e-6
        assert math.dist(before.velocity, after.velocity) <= limits.acceleration_mps2 * STEP_S + 2e-3
        assert before.pose.distance_to(after.pose) <= speed * STEP_S + 1e-6
        assert abs(before.yaw_acceleration) <= limits.yaw_acceleration_radps2 + 1e-6
        assert abs(before.yaw_acceleration - after.yaw_acceleration) <= limits.yaw_jerk_radps3 * STEP_S * 1.001 + 1e-6


def check_end(trajectory: Trajectory, goal: Pose2) -> None:
    end = trajectory.end()
    assert end.pose.distance_to(goal) < 1e-5
    assert abs(wrap_angle(end.pose.yaw - goal.yaw)) < 1e-6
    assert end.speed() < 1e-6
    assert abs(end.yaw_rate) < 1e-6
    later = trajectory.at(trajectory.duration_s + 100.0)
    assert later.pose.distance_to(goal) < 1e-5
    assert later.speed() < 1e-6
    assert math.hypot(*later.acceleration) < 1e-6


def test_duration_of_a_long_straight_way() -> None:
    # To 1 m/s at 1 m/s2 and 2 m/s3: 1 / 1 + 1 / 2 = 1.5 s, 0.75 m; the same at the end; 8.5 m at 1 m/s between.
    trajectory = plan(MotionState(IDENTITY), Pose2(10.0, 0.0, 0.0))
    assert trajectory.duration_s == pytest.approx(1.5 + 8.5 + 1.5)
    middle = trajectory.at(5.75)
    assert (middle.pose.x, middle.pose.y) == pytest.approx((5.0, 0.0))
    assert middle.velocity == pytest.approx((1.0, 0.0))


def test_yaw_turns_evenly_beside_a_diagonal() -> None:
    goal = Pose2(6.0, 8.0, 1.2)
    trajectory = plan(MotionState(IDENTITY), goal)
    middle = trajectory.at(0.5 * trajectory.duration_s)
    assert (middle.pose.x, middle.pose.y, middle.pose.yaw) == pytest.approx((3.0, 4.0, 0.6))
    assert middle.velocity == pytest.approx((0.6, 0.8))
    assert middle.yaw_rate < 0.15  # the 1.2 rad are spread over the whole path
    turned = plan(MotionState(Pose2(1.0, 2.0, 3.0)), Pose2(1.0, 2.0, -3.0))
    assert all(abs(state.pose.yaw) >= 3.0 - 1e-6 for state in states(turned)), "the shorter way"
    state = moving(Pose2(1.0, 2.0, math.pi / 2.0), Twist2(1.0, 0.5, 0.2))
    assert (*state.velocity, state.yaw_rate) == pytest.approx((-0.5, 1.0, 0.2)), "into the map"


def test_a_large_turn_on_a_short_way_slows_the_translation() -> None:
    trajectory = plan(MotionState(IDENTITY), Pose2(0.5, 0.0, 3.0))
    assert trajectory.duration_s == pytest.approx(to_position(3.0, 0.0, 0.0, AxisLimits(1.0, 1.0, 2.0)).duration_s)
    middle = trajectory.at(0.5 * trajectory.duration_s)
    assert (middle.pose.x, middle.pose.yaw) == pytest.approx((0.25, 1.5))


def test_turning_share_slows_the_whole_plan() -> None:
    goal = Pose2(5.0, 0.0, math.pi - 0.01)
    free = plan(MotionState(IDENTITY), goal)
    bound = plan(MotionState(IDENTITY), goal, turning=0.25)
    assert max(state.speed() * abs(state.yaw_rate) for state in states(free)) > 0.5
    assert max(state.speed() * abs(state.yaw_rate) for state in states(bound)) < 0.26
    assert bound.duration_s > free.duration_s
    check_end(bound, goal)


def test_new_goal_at_a_right_angle_is_taken_over_without_a_stop() -> None:
    start = MotionState(IDENTITY, velocity=(1.0, 0.0))
    goal = Pose2(1.0, 6.0, 0.0)
    trajectory = plan(start, goal)
    check_limits(trajectory, LIMITS)
    check_end(trajectory, goal)
    slowest = min(state.speed() for state in states(trajectory) if state.pose.distance_to(goal) > 1.5)
    assert slowest > 0.6  # the chord of the velocity circle over a quarter turn: cos(45 deg) = 0.7


def test_lower_limits_while_driving_brake_smoothly() -> None:
    fast = plan(MotionState(IDENTITY), Pose2(10.0, 0.0, 0.0))
    now = fast.at(4.0)
    slow = MotionLimits(0.3, 1.0, 1.0, 1.0, 2.0, 2.0)
    trajectory = plan(now, Pose2(10.0, 0.0, 0.0), slow)
    check_limits(trajectory, slow, max_speed=1.0)
    check_end(trajectory, Pose2(10.0, 0.0, 0.0))
    assert trajectory.at(2.0).speed() == pytest.approx(0.3, abs=1e-6)
    assert all(state.speed() > 0.299 for state in states(trajectory) if state.pose.x < 9.0)  # no undershoot


def test_stop_from_speed_keeps_the_course() -> None:
    start = MotionState(IDENTITY, velocity=(0.6, 0.8), yaw_rate=0.5)
    trajectory = plan_stop(start, LIMITS)
    check_limits(trajectory, LIMITS)
    end = trajectory.end()
    assert end.speed() < 1e-9
    assert abs(end.yaw_rate) < 1e-9
    # 1 m/s to rest takes 1.5 s and 0.75 m along (0.6, 0.8).
    assert (end.pose.x, end.pose.y) == pytest.approx((0.45, 0.6))


@pytest.mark.parametrize("distance", [0.4, 0.3999999999999999])
def test_where_two_kinds_of_profile_meet(distance: float) -> None:
    # The acceleration just reaches 0.8 m/s2: twice 0.8^3 / 1.6^2 = 0.4 m. The library fails for the second number.
    profile = to_position(distance, 0.0, 0.0, AxisLimits(0.95, 0.8, 1.6))
    assert profile.duration_s == pytest.approx(2.0, abs=1e-3)
    assert profile.at(profile.duration_s)[0] == pytest.approx(0.4)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_not_finite_start_or_goal_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="finite"):
        plan(MotionState(Pose2(bad, 0.0, 0.0)), IDENTITY)
    with pytest.raises(ValueError, match="finite"):
        plan(MotionState(IDENTITY), Pose2(0.0, 0.0, bad))
    with pytest.raises(ValueError, match="no motion profile"):
        to_speed(bad, 0.0, 0.0, AxisLimits(1.0, 1.0, 1.0))


poses = st.builds(Pose2, st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), st.floats(-math.pi, math.pi))
some_limits = st.builds(
    MotionLimits,
    st.floats(0.2, 1.5),
    st.floats(0.2, 1.0),
    st.floats(0.3, 1.0),
    st.floats(0.3, 1.0),
    st.floats(0.5, 2.0),
    st.floats(0.5, 2.0),
)


@given(poses, poses, some_limits)
@settings(max_examples=30, deadline=None)
def test_from_rest_every_limit_is_kept(start: Pose2, goal: Pose2, limits: MotionLimits) -> None:
    trajectory = plan(MotionState(start), goal, limits, 0.5 * limits.acceleration_mps2)
    check_limits(trajectory, limits)
    check_end(trajectory, goal)
    assert max(abs(state.yaw_rate) for state in states(trajectory)) <= limits.yaw_rate_radps + 1e-6


@given(poses, poses, poses, some_limits, st.floats(0.0, 1.0))
@settings(max_examples=30, deadline=None)
def test_a_new_goal_at_any_moment_keeps_every_limit(
    start: Pose2, first: Pose2, second: Pose2, limits: MotionLimits, share: float
) -> None:
    before = plan(MotionState(start), first, limits, 0.5 * limits.acceleration_mps2)
    now = before.at(share * before.duration_s)
    after = plan(now, second, limits, 0.5 * limits.acceleration_mps2)
    check_limits(after, limits)
    check_end(after, second)
    begin = after.at(0.0)
    assert begin.pose.distance_to(now.pose) < 1e-9
    assert math.dist(begin.velocity, now.velocity) < 2e-3
    assert math.dist(begin.acceleration, now.acceleration) < 2e-2
