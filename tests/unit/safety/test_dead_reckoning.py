"""The robot's motion by wheel odometry, and its pose a moment ago."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2
from robot_stack.safety.dead_reckoning import DeadReckoning, Modules

POSITIONS_M = ((0.3, 0.25), (0.3, -0.25), (-0.3, 0.25), (-0.3, -0.25))


def test_modules_agree_on_a_twist() -> None:
    modules = Modules(POSITIONS_M, 0.08)
    for twist in (Twist2(1.0, 0.0, 0.0), Twist2(0.3, -0.4, 0.0), Twist2(0.0, 0.0, 0.7), Twist2(0.5, 0.2, -0.6)):
        velocities = [(twist.vx - twist.omega * y, twist.vy + twist.omega * x) for x, y in modules.positions_m]
        found = modules.twist([math.hypot(*v) for v in velocities], [math.atan2(v[1], v[0]) for v in velocities])
        assert (found.vx, found.vy, found.omega) == pytest.approx((twist.vx, twist.vy, twist.omega))


@pytest.mark.parametrize(("speeds", "angles"), [(4, 5), (5, 4), (3, 3), (5, 5)])
def test_a_module_too_few_or_too_many_is_refused(speeds: int, angles: int) -> None:
    with pytest.raises(ValueError, match="zip"):
        Modules(POSITIONS_M, 0.08).twist([0.1] * speeds, [0.0] * angles)


def test_it_begins_where_the_robot_stands_and_stands() -> None:
    dead_reckoning = DeadReckoning(0.3)
    assert dead_reckoning.pose_at(1.0) == dead_reckoning.pose == IDENTITY
    assert dead_reckoning.twist == ZERO_TWIST


def test_dead_reckoning_integrates_the_twist_and_skips_gaps() -> None:
    dead_reckoning = DeadReckoning(0.3)
    twist = Twist2(1.0, 0.0, 0.0)
    dead_reckoning.update(twist, 5.0)
    assert (dead_reckoning.pose, dead_reckoning.twist) == (IDENTITY, twist)
    dead_reckoning.update(twist, 5.3)
    assert dead_reckoning.pose.x == pytest.approx(0.3)
    dead_reckoning.update(twist, 5.61)
    dead_reckoning.update(twist, 5.0)  # the clock jumped backwards
    assert dead_reckoning.pose.x == pytest.approx(0.3)
    dead_reckoning.update(Twist2(-2.0, 0.0, 0.0), 5.1)
    assert dead_reckoning.pose.x == pytest.approx(0.1)
    assert dead_reckoning.pose_at(5.2).x == pytest.approx(-0.1)
    assert dead_reckoning.pose_at(5.0).x == pytest.approx(0.3)
    assert dead_reckoning.pose_at(5.39).x == pytest.approx(0.1 - 0.58)
    assert dead_reckoning.pose_at(5.41).x == pytest.approx(0.1)


def test_it_turns_with_the_robot() -> None:
    dead_reckoning = DeadReckoning(0.5)
    quarter = Twist2(0.0, 0.0, math.pi)
    dead_reckoning.update(quarter, 0.0)
    dead_reckoning.update(quarter, 0.5)
    dead_reckoning.update(Twist2(1.0, 0.0, 0.0), 0.75)
    expected = Pose2(0.0, 0.25, math.pi / 2)
    assert dead_reckoning.pose.distance_to(expected) < 1e-9
    assert dead_reckoning.pose.yaw == pytest.approx(expected.yaw)


def test_the_longest_gap_is_no_gap_yet() -> None:
    """Times that binary floating point represents exactly."""
    dead_reckoning = DeadReckoning(0.25)
    dead_reckoning.update(Twist2(1.0, 0.0, 0.0), 5.0)
    dead_reckoning.update(Twist2(1.0, 0.0, 0.0), 5.25)
    assert dead_reckoning.pose.x == 0.25
    assert dead_reckoning.pose_at(5.5).x == 0.5
    assert dead_reckoning.pose_at(5.0).x == 0.0
