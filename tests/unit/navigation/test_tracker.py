"""Feed-forward, feedback and their bounds; limits; parameters."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.config import ConfigError
from robot_stack.core.geometry import IDENTITY, Pose2, Twist2
from robot_stack.core.limits import NO_LIMIT, SpeedLimit
from robot_stack.navigation.limits import planning_limits
from robot_stack.navigation.motion import MotionState
from robot_stack.navigation.tracker import begun, bounded, command, settle_command, waiting_rate
from tests.unit.navigation.plant import ROBOT, params

TRACKING = params().tracking


SIDEWAYS = MotionState(Pose2(1.0, 1.0, math.pi / 2.0), velocity=(0.0, 1.0))
SLOW, SOON = MotionState(IDENTITY, velocity=(0.5, 0.0)), MotionState(IDENTITY, velocity=(0.6, 0.0), yaw_rate=0.1)
ROUND = MotionState(IDENTITY, velocity=(1.0, 0.0), yaw_rate=1.0)
ROUND_SOON = MotionState(Pose2(0.1, 0.0, 0.1), velocity=(1.0, 0.0), yaw_rate=1.0)


@pytest.mark.parametrize(
    ("now", "ahead", "rate", "expected"),
    [
        (SIDEWAYS, SIDEWAYS, 1.0, (1.0, 0.0, 0.0)),
        (SLOW, SOON, 1.0, (0.6, 0.0, 0.1)),
        (ROUND, ROUND_SOON, 1.0, (math.cos(0.1), -math.sin(0.1), 1.0)),
        (ROUND, ROUND, 0.5, (0.5, 0.0, 0.5)),
    ],
    ids=["in the body", "when it acts", "the yaw when it acts", "a slower plan"],
)
def test_on_the_plan(now: MotionState, ahead: MotionState, rate: float, expected: tuple[float, float, float]) -> None:
    twist = command(now, ahead, now.pose, TRACKING, rate=rate)
    assert (twist.vx, twist.vy, twist.omega) == pytest.approx(expected)


def test_error_pulls_back_and_is_bounded() -> None:
    state = MotionState(IDENTITY)
    near = command(state, state, Pose2(0.0, -0.1, 0.05), TRACKING)
    assert math.hypot(near.vx, near.vy) == pytest.approx(1.5 * 0.1)
    assert near.vy > 0.149 * math.cos(0.05)
    assert near.omega == pytest.approx(-2.0 * 0.05)
    far = command(state, state, Pose2(-5.0, 0.0, 3.0), TRACKING)
    assert far.speed() == pytest.approx(TRACKING.max_correction_mps)
    assert far.omega == pytest.approx(-TRACKING.max_correction_radps)


@pytest.mark.parametrize(
    ("pose", "rate"),
    [
        (Pose2(0.0, 0.0, 0.0), 1.0),
        (Pose2(-0.03, 0.0, 0.0), 1.0),
        (Pose2(-0.065, 0.0, 0.0), 0.5),  # halfway between 0.03 and 0.10 m
        (Pose2(-0.2, 0.0, 0.0), 0.0),
        (Pose2(0.2, 0.0, 0.0), 1.0),  # ahead of the plan
        (Pose2(0.0, 0.2, 0.0), 1.0),  # beside it
        (Pose2(0.0, 0.0, -0.1), 0.5),  # halfway between 0.05 and 0.15 rad
        (Pose2(0.0, 0.0, 0.1), 1.0),
        (Pose2(-0.065, 0.0, -0.15), 0.0),
    ],
)
def test_the_plan_waits_for_a_robot_that_is_behind(pose: Pose2, rate: float) -> None:
    planned = MotionState(IDENTITY, velocity=(1.0, 0.0), yaw_rate=0.2)
    assert waiting_rate(planned, pose, TRACKING) == pytest.approx(rate)
    assert waiting_rate(MotionState(IDENTITY), Pose2(-0.5, 0.0, -0.5), TRACKING) == 1.0, "a plan at rest"


def test_begun_means_moved_towards_the_plan() -> None:
    start, soon = MotionState(IDENTITY), MotionState(IDENTITY, velocity=(0.0, 0.02))
    assert begun(start, soon, Pose2(0.0, 0.0015, 0.0), TRACKING)
    assert not begun(start, soon, Pose2(0.01, 0.0005, 0.1), TRACKING)  # a remaining earlier motion
    turning = MotionState(IDENTITY, yaw_rate=-0.02)
    assert begun(start, turning, Pose2(0.0, 0.0, -0.003), TRACKING)
    assert not begun(start, turning, Pose2(0.0, 0.0, 0.003), TRACKING)


def test_bound_keeps_the_course() -> None:
    twist = bounded(Twist2(3.0, 4.0, -9.0), 1.0, 0.5)
    assert (twist.vx, twist.vy, twist.omega) == pytest.approx((0.6, 0.8, -0.5))
    assert bounded(Twist2(0.1, 0.2, 0.3), math.inf, math.inf) == Twist2(0.1, 0.2, 0.3)
    assert bounded(Twist2(1.0, 0.0, 1.0), 0.0, 0.0) == Twist2(0.0, 0.0, 0.0)


def test_settling_drives_straight_to_the_goal() -> None:
    limits = planning_limits(ROBOT.empty, SpeedLimit(0.1, 0.2), params().limits)
    assert limits is not None
    twist = settle_command(Pose2(0.0, 0.02, 0.0), Pose2(0.0, 0.0, math.pi / 2.0), limits.cruise, TRACKING)
    assert (twist.vx, twist.vy) == pytest.approx((0.03, 0.0))
    assert twist.omega == pytest.approx(-0.19)  # 95 % of 0.2


def test_planning_limits_take_the_smallest() -> None:
    share = params().limits
    free = planning_limits(ROBOT.empty, NO_LIMIT, share)
    assert free is not None
    assert free.cruise.speed_mps == pytest.approx(0.95 * 1.5)
    assert free.cruise.acceleration_mps2 == pytest.approx(0.7 * 1.0)
    passenger = planning_limits(ROBOT.with_passenger, NO_LIMIT, share)
    assert passenger is not None
    assert passenger.cruise.speed_mps == pytest.approx(0.95 * 1.0)
    assert passenger.cruise.jerk_mps3 == pytest.approx(0.7 * 1.0)
    assert passenger.braking.jerk_mps3 == 1.0
    assert passenger.max_turning_mps2 == pytest.approx(0.35 * 0.5)
    slow = planning_limits(ROBOT.empty, SpeedLimit(0.3, 0.4), share)
    assert slow is not None
    assert (slow.cruise.speed_mps, slow.cruise.yaw_rate_radps) == pytest.approx((0.285, 0.38))


@pytest.mark.parametrize("limit", [SpeedLimit(0.0, 1.0), SpeedLimit(1.0, 0.0), SpeedLimit(math.nan, 1.0)])
def test_no_limits_without_remaining_reserve(limit: SpeedLimit) -> None:
    assert planning_limits(ROBOT.empty, limit, params().limits) is None


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ({"plan_spacing_m": 0.0}, "plan_spacing_m"),
        ({"limits": {**params().limits.model_dump(), "speed_share": 1.2}}, "limits.speed_share"),
        ({"tracking": {**TRACKING.model_dump(), "wait_at_m": 0.5}}, "wait_from_m < wait_at_m < replan_position_m"),
        ({"tracking": {**TRACKING.model_dump(), "wait_from_rad": 0.2}}, "wait_from_rad < wait_at_rad"),
        ({"goal": {**params().goal.model_dump(), "settled_position_m": 0.05}}, "settled_position_m must be smaller"),
    ],
)
def test_illegal_parameters_are_named(override: dict[str, object], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        params(**override)
