"""Swerve kinematics compared with values computed by hand and with WPILib."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.geometry import Twist2
from robot_stack.drive.kinematics import (
    cosine_scale,
    desaturated,
    fastest_wheel_mps,
    nearest_equivalent,
    steering_step,
    turn_to,
    wheel_velocities,
    wrapped,
    x_lock_angles,
)
from tests.unit.drive.robot import POSITIONS

speeds = st.floats(-2.0, 2.0)
angles = st.floats(-50.0, 50.0)
wheel_directions = st.sampled_from([1.0, -1.0])
HYSTERESIS = math.radians(10.0)


def test_worst_corner_needs_desaturation():
    # robot_facts 1.3: 1.5 m/s with 1.0 rad/s needs 1.89 m/s at a corner in the direction of motion.
    direction = math.atan2(0.30, 0.25)
    twist = Twist2(1.5 * math.sin(direction), -1.5 * math.cos(direction), 1.0)
    assert fastest_wheel_mps(POSITIONS, twist) == pytest.approx(1.89, abs=0.01)


@given(speeds, speeds, speeds)
def test_inverse_agrees_with_wpilib(vx: float, vy: float, omega: float):
    from wpimath.geometry import Translation2d
    from wpimath.kinematics import ChassisSpeeds, SwerveDrive4Kinematics

    oracle = SwerveDrive4Kinematics(*(Translation2d(x, y) for x, y in POSITIONS))
    states = oracle.toSwerveModuleStates(ChassisSpeeds(vx, vy, omega))
    for (wx, wy), state in zip(wheel_velocities(POSITIONS, Twist2(vx, vy, omega)), states, strict=True):
        if state.speed > 2e-6:  # below 1e-6 WPILib reports no direction
            assert wx == pytest.approx(state.speed * state.angle.cos(), abs=1e-9)
            assert wy == pytest.approx(state.speed * state.angle.sin(), abs=1e-9)
        else:
            assert math.hypot(wx, wy) < 3e-6


@given(speeds, speeds, speeds, st.floats(0.1, 3.0))
def test_desaturation_keeps_the_direction_and_fits(vx: float, vy: float, omega: float, limit: float):
    twist = Twist2(vx, vy, omega)
    slower = desaturated(POSITIONS, twist, limit)
    assert fastest_wheel_mps(POSITIONS, slower) <= limit * (1.0 + 1e-12)
    factor = min(1.0, limit / fastest_wheel_mps(POSITIONS, twist)) if twist != Twist2(0.0, 0.0, 0.0) else 1.0
    assert (slower.vx, slower.vy, slower.omega) == pytest.approx((vx * factor, vy * factor, omega * factor), abs=1e-12)


def test_x_lock_points_at_the_centre():
    # atan2(0.25, 0.30) = 39.8 deg; FL and RR share a diagonal, FR and RL the other.
    assert [math.degrees(a) for a in x_lock_angles(POSITIONS)] == pytest.approx(
        [39.806, -39.806, -39.806, 39.806], abs=1e-3
    )


@pytest.mark.parametrize(
    ("direction_deg", "angle_deg", "wheel_direction", "turn_deg", "new_direction"),
    [
        (0.0, 0.0, 1.0, 0.0, 1.0),
        (80.0, 0.0, 1.0, 80.0, 1.0),
        (99.0, 0.0, 1.0, 99.0, 1.0),  # within the hysteresis: no reversal
        (101.0, 0.0, 1.0, -79.0, -1.0),
        (180.0, 0.0, 1.0, 0.0, -1.0),
        (-101.0, 0.0, 1.0, 79.0, -1.0),
        (180.0, 0.0, -1.0, 0.0, -1.0),  # already rolling backward
        (85.0, 0.0, -1.0, -95.0, -1.0),
        (79.0, 0.0, -1.0, 79.0, 1.0),
        (-170.0, 170.0, 1.0, 20.0, 1.0),  # through the wrap
        (10.0, 3600.0, 1.0, 10.0, 1.0),  # ten turns on
    ],
)
def test_turn_to(direction_deg: float, angle_deg: float, wheel_direction: float, turn_deg: float, new_direction: float):
    turn, got = turn_to(math.radians(direction_deg), math.radians(angle_deg), wheel_direction, HYSTERESIS)
    assert math.degrees(turn) == pytest.approx(turn_deg, abs=1e-9)
    assert got == new_direction


@given(angles, angles, wheel_directions)
def test_turn_to_always_ends_on_the_direction(direction: float, angle: float, wheel_direction: float):
    turn, new_direction = turn_to(direction, angle, wheel_direction, HYSTERESIS)
    assert abs(turn) <= math.pi / 2 + HYSTERESIS + 1e-9
    heading = angle + turn + (0.0 if new_direction > 0.0 else math.pi)
    assert math.cos(heading - direction) == pytest.approx(1.0, abs=1e-9)


@given(angles, angles, wheel_directions)
def test_turn_to_without_hysteresis_agrees_with_wpilib(direction: float, angle: float, wheel_direction: float):
    from wpimath.geometry import Rotation2d
    from wpimath.kinematics import SwerveModuleState

    turn, new_direction = turn_to(direction, angle, wheel_direction, 0.0)
    if abs(abs(turn) - math.pi / 2) < 1e-6:
        return  # both results are valid at exactly 90 deg
    state = SwerveModuleState(1.0, Rotation2d(direction))
    state.optimize(Rotation2d(angle))
    assert math.copysign(1.0, state.speed) == new_direction
    assert math.cos(state.angle.radians() - (angle + turn)) == pytest.approx(1.0, abs=1e-9)


@given(angles, angles)
def test_nearest_equivalent(angle: float, reference: float):
    near = nearest_equivalent(angle, reference)
    assert -math.pi <= wrapped(angle) <= math.pi
    assert abs(near - reference) <= math.pi + 1e-9
    assert math.cos(near - angle) == pytest.approx(1.0, abs=1e-9)


def test_cosine_scale():
    assert cosine_scale(0.0) == 1.0
    assert cosine_scale(math.radians(60.0)) == pytest.approx(0.5)
    assert cosine_scale(math.radians(120.0)) == 0.0
    assert cosine_scale(math.radians(-60.0)) == pytest.approx(0.5)


@given(st.floats(-1.8, 1.8), st.floats(0.01, 0.1), st.floats(1.0, 10.0), st.floats(5.0, 100.0))
def test_steering_arrives_without_overshoot(turn: float, dt_s: float, max_rate: float, max_acceleration: float):
    left, rate = turn, 0.0
    for _ in range(100_000):
        before = rate
        step, rate = steering_step(left, rate, max_rate, max_acceleration, dt_s)
        left -= step
        assert abs(rate) <= max_rate * (1 + 1e-12)
        assert abs(rate - before) <= max_acceleration * dt_s * (1 + 1e-9)
        assert left * turn >= -1e-9  # no overshoot
        if abs(left) < 1e-9 and abs(rate) < 1e-6:
            break
    assert abs(left) < 1e-9
    assert rate == pytest.approx(0.0, abs=1e-6)


def test_steering_follows_a_steadily_turning_target_exactly():
    """A target at 2 rad/s, below the 3 rad/s that 60 rad/s2 reaches in 0.05 s: no lag after it is reached."""
    angle = rate = 0.0
    for k in range(1, 40):
        step, rate = steering_step(2.0 * 0.05 * k - angle, rate, 8.0, 60.0, 0.05)
        angle += step
    assert angle == pytest.approx(2.0 * 0.05 * 39)
