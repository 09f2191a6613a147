"""Conversion of wheel commands to axis moves."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.config import load
from robot_stack.drive.hardware_params import SwerveHardwareParams, axis_settings
from robot_stack.drive.wheel_axes import BadWheelCommands, checked_set_points, drive_moves, steer_moves, stop_moves
from tests.unit.drive.robot import ROBOT

SETTINGS = axis_settings(load(SwerveHardwareParams, "swerve_hardware_interface"), ROBOT, 20.0)
RADIUS = ROBOT.wheel_radius_m
MAX_MPS = SETTINGS.max_wheel_speed_mps
speeds = st.floats(-2.0, 2.0)
IDS, STILL, AHEAD = [0, 1, 2, 3], [0.0] * 4, [0.0] * 4


@pytest.mark.parametrize(
    ("ids", "speeds_mps", "angles_rad", "says"),
    [
        ([0, 1, 2, 2], STILL, AHEAD, "module_id must be 0..3, each once, is 0, 1, 2, 2"),
        ([0, 1, 2, 4], STILL, AHEAD, "module_id must be"),
        ([], [], [], "module_id must be 0..3, each once, is empty"),
        (IDS, [0.0, math.nan, 0.0, 0.0], AHEAD, r"drive_velocity of fr must be within \+-2.475 m/s, is nan"),
        (IDS, [0.0, 0.0, 0.0, 2.5], AHEAD, "drive_velocity of rr must be within"),
        (IDS, STILL, [0.0, 0.0, math.nan, 0.0], r"steering_angle of rl must be within \+-pi rad, is nan"),
        (IDS, STILL, [3.2, 0.0, 0.0, 0.0], "steering_angle of fl must be within"),
    ],
)
def test_refusals_name_field_and_limit(ids: list[int], speeds_mps: list[float], angles_rad: list[float], says: str):
    with pytest.raises(BadWheelCommands, match=says):
        checked_set_points(ids, speeds_mps, angles_rad, MAX_MPS)


def test_set_points_are_sorted_by_module_and_may_reach_their_limits():
    got = checked_set_points([2, 0, 3, 1], [-MAX_MPS, 0.0, MAX_MPS, 0.1], [math.pi, 0.0, -math.pi, 1.0], MAX_MPS)
    assert (got.speeds_mps, got.angles_rad) == ((0.0, 0.1, -MAX_MPS, MAX_MPS), (0.0, 1.0, math.pi, -math.pi))


def test_an_ordinary_change_takes_exactly_one_period():
    # 0.4 to 0.45 m/s in 50 ms: 1 m/s2 at the rim, 12.12 rad/s2 at the wheel.
    moves = drive_moves((0.45, 0.45, 0.45, 0.45), [0.4 / RADIUS] * 4, SETTINGS)
    assert [move.axis for move in moves] == [0, 2, 4, 6]
    assert [move.velocity_radps for move in moves] == pytest.approx([0.45 / RADIUS] * 4)
    assert [move.acceleration_radps2 for move in moves] == pytest.approx([1.0 / RADIUS] * 4)


def test_a_leap_is_spread_over_the_time_it_needs_and_all_wheels_arrive_together():
    # The largest change, 1.0 m/s at 4.0 m/s2, takes 0.25 s; the others take as long.
    moves = drive_moves((1.0, 0.5, -0.5, 0.25), [0.0] * 4, SETTINGS)
    assert [move.acceleration_radps2 * RADIUS for move in moves] == pytest.approx([4.0, 2.0, 2.0, 1.0])
    # Within the lifetime of one command, 0.2 s, it reaches 4/5 of the change.
    assert [move.velocity_radps * RADIUS for move in moves] == pytest.approx([0.8, 0.4, -0.4, 0.2])
    assert [move.reached_s for move in moves] == pytest.approx([0.2] * 4)


def test_wheels_that_slow_down_would_be_stopped_as_they_slow_down():
    # 1.0 to 0.95 m/s in 50 ms is exactly 1 m/s2; 1.0 to 0.975 m/s would be half of it.
    slowing, growing, through, harder = drive_moves(
        (0.95, 1.0, -0.05, 0.8), [1.0 / RADIUS, 0.95 / RADIUS, 0.05 / RADIUS, 1.0 / RADIUS], SETTINGS
    )
    assert (slowing.deceleration_radps2 * RADIUS, slowing.reached_s) == pytest.approx((1.0, 0.05))
    softer = drive_moves((0.975,) * 4, [1.0 / RADIUS] * 4, SETTINGS)[0]
    assert (softer.deceleration_radps2 * RADIUS, softer.reached_s) == pytest.approx((1.0, 0.025))
    steady = drive_moves((0.999,) * 4, [1.0 / RADIUS] * 4, SETTINGS)[0]
    assert steady.deceleration_radps2 * RADIUS == pytest.approx(2.0)
    assert (growing.deceleration_radps2 * RADIUS, growing.acceleration_radps2 * RADIUS) == pytest.approx((2.0, 1.0))
    assert growing.growth_s == pytest.approx(growing.reached_s) == pytest.approx(0.05)
    assert (through.growth_s, through.reached_s) == pytest.approx((0.025, 0.05))
    assert through.deceleration_radps2 * RADIUS == pytest.approx(2.0)
    assert (harder.deceleration_radps2 * RADIUS, harder.reached_s) == pytest.approx((4.0, 0.05))


@given(st.tuples(speeds, speeds, speeds, speeds), st.tuples(speeds, speeds, speeds, speeds))
def test_no_change_outlasts_the_life_of_its_command(now: tuple[float, ...], wanted: tuple[float, ...]):
    """Without further commands the engine brakes ``command_lifetime_s`` after the last one."""
    moves = drive_moves(wanted, [speed / RADIUS for speed in now], SETTINGS)  # type: ignore[arg-type]
    if any(wanted):
        for move, before, after in zip(moves, now, wanted, strict=True):
            assert move.reached_s <= SETTINGS.command_lifetime_s + 1e-9
            low, high = sorted((before, after))
            assert low - 1e-9 <= move.velocity_radps * RADIUS <= high + 1e-9


def test_zero_for_all_wheels_is_a_stop_at_the_emergency_deceleration():
    # 1.0 m/s at 2.0 m/s2: 0.5 s for all.
    moves = drive_moves((0.0, 0.0, 0.0, 0.0), [1.0 / RADIUS, 0.5 / RADIUS, 1.0 / RADIUS, 0.5 / RADIUS], SETTINGS)
    assert [move.acceleration_radps2 * RADIUS for move in moves] == pytest.approx([2.0, 1.0, 2.0, 1.0])
    assert [move.deceleration_radps2 * RADIUS for move in moves] == pytest.approx([2.0, 1.0, 2.0, 1.0])
    assert [move.velocity_radps for move in moves] == [0.0] * 4


@given(st.tuples(speeds, speeds, speeds, speeds))
def test_stop_asked_for_again_and_again_is_one_even_ramp(start: tuple[float, float, float, float]):
    """Sampled every 20 ms: the fastest wheel loses 2.0 m/s2, the others in proportion, until all stand."""
    velocities = [speed / RADIUS for speed in start]
    for _ in range(100):
        moves = stop_moves(velocities, SETTINGS)
        before = velocities
        velocities = [
            math.copysign(max(0.0, abs(v) - 0.02 * move.acceleration_radps2), v)
            for v, move in zip(velocities, moves, strict=True)
        ]
        loss = max(abs(b) - abs(v) for b, v in zip(before, velocities, strict=True)) * RADIUS
        assert loss <= 2.0 * 0.02 + 1e-9
    assert velocities == pytest.approx([0.0] * 4, abs=1e-12)


def test_steering_is_paced_and_limited():
    # 0.06 rad in 1.2 periods of 50 ms is 1 rad/s; half a turn is limited by the axis.
    moves = steer_moves((0.06, 0.0, 3.0, -0.06), [0.0] * 4, SETTINGS)
    assert [move.axis for move in moves] == [1, 3, 5, 7]
    assert [move.rate_radps for move in moves] == pytest.approx([1.0, 0.05, ROBOT.steer.max_rate_radps, 1.0])
    assert {move.acceleration_radps2 for move in moves} == {ROBOT.steer.max_acceleration_radps2}


@given(st.floats(-math.pi, math.pi), st.floats(-100.0, 100.0))
def test_no_heading_ever_turns_more_than_half_a_turn(angle: float, position: float):
    move = steer_moves((angle, 0.0, 0.0, 0.0), [position, 0.0, 0.0, 0.0], SETTINGS)[0]
    assert abs(move.target_rad - position) <= math.pi + 1e-9
    assert math.cos(move.target_rad - angle) == pytest.approx(1.0, abs=1e-9)
