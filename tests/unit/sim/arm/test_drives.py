"""The joint drives in physics: they hold the arm's weight, follow, keep their limits, and end in a safe state."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from sim.plant.drive_loops import (
    ALARM_BUS,
    ALARM_FOLLOWING_ERROR,
    ALARM_INVALID_COMMAND,
    ALARM_NONE,
    ALARM_OVERLOAD,
)
from tests.unit.sim.arm.rig import DT_S, STRETCHED, ArmRig

_GRAVITY_MPS2 = 9.81
_TRACKING_RAD = 0.005


def weight_at_joint_2(rig: ArmRig) -> float:
    """Returns the torque about joint 2 of the arm stretched out horizontally, Nm, from masses and lengths alone."""
    body, gripper, mass = rig.params.body, rig.params.gripper, rig.params.body.mass_kg
    elbow, wrist = body.upper_arm_m, body.upper_arm_m + body.forearm_m
    spread = 1.0 - body.elbow_share
    levers = [
        (spread * mass.upper_arm, 0.5 * elbow),
        (body.elbow_share * mass.upper_arm, elbow),
        (spread * mass.forearm, elbow + 0.5 * body.forearm_m),
        (body.elbow_share * mass.forearm, wrist),
        (mass.wrist1, wrist),
        (mass.wrist2, wrist + 0.5 * body.wrist_m),
        (mass.wrist3 + gripper.mass_kg + 2.0 * gripper.finger_mass_kg, wrist + body.wrist_m),
    ]
    return _GRAVITY_MPS2 * sum(kilograms * lever for kilograms, lever in levers)


def test_the_stretched_arm_is_held_by_its_motors() -> None:
    rig = ArmRig(start_rad=STRETCHED).on()
    rig.run(1.0)
    assert np.abs(rig.truth - np.array(STRETCHED)).max() < 1e-4
    motor = rig.arm.bus.motor_torques_nm
    expected = weight_at_joint_2(rig)
    assert expected == pytest.approx(36.1, abs=0.1)
    # Dry friction carries a part of it, which depends on how the joint came to rest.
    assert -motor[1] == pytest.approx(expected, abs=rig.params.kind(1).friction_nm)
    # The engine reads it in percent of the rated torque, in the encoder's direction, which is reversed here.
    assert rig.inp.torque_percent[1] == pytest.approx(-100.0 * motor[1] / rig.rated_nm[1], abs=0.1)


def test_brakes_close_and_open_without_dropping_arm() -> None:
    rig = ArmRig(start_rad=STRETCHED)
    rig.run(1.0)  # never switched on
    assert np.abs(rig.truth - np.array(STRETCHED)).max() < 1e-4
    low = np.inf
    rig.out.servo_on[:] = True
    for _ in range(200):
        rig.cycle()
        assert not (rig.inp.servo_on & rig.arm.bus.brakes_closed).any(), "on is reported when the brake is open"
        low = min(low, -abs(float(rig.truth[1]) - STRETCHED[1]))
    assert rig.inp.servo_on.all()
    assert low > -0.001
    rig.out.servo_on[:] = False
    rig.run(1.0)
    assert rig.arm.bus.brakes_closed.all()
    assert not rig.inp.servo_on.any()
    assert np.abs(rig.truth - np.array(STRETCHED)).max() < 0.001


def test_a_random_spline_is_followed_and_not_finite_commands_are_an_alarm() -> None:
    """Up to 2 rad/s: one cycle of the bus alone is 0.002 rad."""
    random = np.random.default_rng(1)
    knots = random.uniform(-0.8, 0.8, (5, 6))
    start = np.array([0.0, 0.3, 0.6, 0.0, 0.3, 0.0])
    spline = CubicSpline(np.arange(6) * 0.8, start + np.vstack([np.zeros(6), knots]), bc_type="clamped")
    fastest = float(np.abs(spline(np.arange(0.0, 4.0, 0.01), 1)).max())
    slowed = max(1.0, fastest / 2.0)
    rig = ArmRig(start_rad=tuple(start)).on()

    def path(t: float, derivative: int = 0) -> np.ndarray:
        return np.asarray(spline(t / slowed, derivative)) / slowed**derivative

    rig.follow(path, 4.0 * slowed)
    assert rig.worst.max() < _TRACKING_RAD
    assert rig.worst.max() > 0.0005  # the arm has moved
    assert not rig.inp.alarm_code.any()
    before = rig.truth
    rig.out.velocity_counts_per_s[1] = math.nan
    rig.run(0.05)
    assert rig.inp.alarm_code[1] == ALARM_INVALID_COMMAND
    assert rig.arm.bus.brakes_closed[1]
    assert np.abs(rig.truth - before).max() < 0.01


def test_three_kilograms_are_carried_within_the_motors_limits() -> None:
    rig = ArmRig(start_rad=(0.0, -0.2, 0.3, 0.0, 0.0, 0.0), payload_kg=3.0).on()
    limits = np.array([rig.params.kind(axis).max_torque_nm for axis in range(6)])
    start = rig.commanded
    path = CubicSpline([0.0, 1.5], np.vstack([start, start + 1.0]), bc_type="clamped")
    highest = np.zeros(6)
    for step in range(1, 1501):
        rig.command(path(step * DT_S), path(step * DT_S, 1))
        rig.cycle()
        np.maximum(highest, np.abs(rig.arm.bus.motor_torques_nm), out=highest)
    assert (highest < limits).all()
    assert np.abs(rig.commanded - rig.positions).max() < _TRACKING_RAD


def test_a_load_beyond_the_motor_is_an_alarm_and_the_brake_holds_it() -> None:
    rig = ArmRig(
        start_rad=(*STRETCHED[:4], math.pi / 2, 0.0)
    ).on()  # the gripper is upright, so the wrist holds no weight
    rig.arm.set_payload(12.0)  # 73 Nm in addition to the 36 Nm of the arm; the motor has 90 Nm
    highest = 0.0
    for _ in range(1500):
        rig.cycle()
        highest = max(highest, abs(float(rig.arm.bus.motor_torques_nm[1])))
    assert highest <= rig.params.kind(1).max_torque_nm + 1e-9
    assert rig.inp.alarm_code[1] in (ALARM_OVERLOAD, ALARM_FOLLOWING_ERROR)
    assert not rig.inp.servo_on[1]
    assert rig.arm.bus.brakes_closed[1]
    before = rig.truth[1]
    rig.run(0.5)
    assert abs(rig.truth[1] - before) < 1e-3


def test_a_blocked_joint_ends_in_an_overload_alarm_of_its_drive_alone() -> None:
    rig = ArmRig().on()
    rig.arm.bus.set_blocked(2, True)
    start = rig.truth
    rig.go(rig.commanded + np.array([0.2, 0.0, 0.2, 0.0, 0.0, 0.2]), 1.0)
    assert rig.inp.alarm_code.tolist() == [0, 0, ALARM_OVERLOAD, 0, 0, 0]
    assert abs(rig.truth[2] - start[2]) < 0.01
    assert rig.truth[0] == pytest.approx(start[0] + 0.2, abs=1e-3)
    rig.arm.bus.set_blocked(2, False)
    rig.command(rig.positions)
    rig.out.clear_alarm[2] = True
    rig.run(0.3)
    assert not rig.inp.alarm_code.any()
    assert rig.inp.servo_on.all()


def test_loss_of_the_bus_in_motion_brakes_the_arm() -> None:
    rig = ArmRig(start_rad=(0.0, 1.0, 0.5, 0.0, 0.0, 0.0)).on()
    start, rate = rig.commanded, np.array([1.5, -1.0, 1.0, 1.5, 1.5, 1.5])
    ramp = CubicSpline([0.0, 0.5], np.vstack([start, start + 0.25 * rate]), bc_type=((1, 0 * rate), (1, rate)))
    rig.follow(lambda t, derivative=0: np.asarray(ramp(t, derivative)), 0.5)
    assert np.abs(rig.speeds).min() > 0.9
    rig.arm.bus.set_bus(False)
    rig.cycle()
    assert not rig.connected
    rig.run(0.1 + 0.15)  # the drives' watchdog, then 15 rad/s2 from 1.5 rad/s, and the brakes
    assert np.abs(rig.speeds).max() < 0.02
    assert rig.arm.bus.brakes_closed.all()
    assert (rig.arm.bus.alarm_codes == ALARM_BUS).all()
    stood = rig.truth
    rig.run(0.5)
    assert np.abs(rig.truth - stood).max() < 1e-3
    rig.arm.bus.set_bus(True)
    rig.cycle()
    assert (rig.inp.alarm_code == ALARM_BUS).all()
    assert not rig.inp.servo_on.any()


def test_a_lost_encoder_is_an_alarm_until_it_is_back_and_cleared() -> None:
    rig = ArmRig().on()
    rig.arm.fault_kinds["encoder_loss"].change(rig.arm, "joint4", 0.0)
    rig.run(0.1)
    assert rig.inp.alarm_code[3] == 0x7305
    assert not rig.inp.servo_on[3]
    rig.out.clear_alarm[3] = True
    rig.run(0.1)
    assert rig.inp.alarm_code[3] == 0x7305
    rig.arm.fault_kinds["encoder_loss"].change(rig.arm, "joint4", None)
    rig.run(0.3)
    assert rig.inp.alarm_code[3] == ALARM_NONE
    assert rig.inp.servo_on[3]
