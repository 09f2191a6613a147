"""The controller carries out a permission: driving, a hard stop at the emergency deceleration, zero at once."""

from __future__ import annotations

import pytest

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.drive.arbitration import Command
from robot_stack.drive.controller import SwerveController
from robot_stack.drive.odometry import Encoders
from robot_stack.drive.permission import Action, Permission
from robot_stack.drive.swerve_drive import DriveOutput
from tests.unit.drive.robot import EMPTY, PARAMS, ROBOT, TICK_S

FORWARD = Twist2(1.0, 0.0, 0.0)
STOPS_IN_S = 1.0 / ROBOT.emergency_deceleration_mps2


class Ride:
    """Wheels that follow their set points at once."""

    def __init__(self) -> None:
        self.controller = SwerveController(PARAMS, ROBOT)
        self.now_s, self.drive_rad = 0.0, [0.0] * 4
        self.observe((0.0,) * 4)

    def observe(self, angles_rad: tuple[float, float, float, float]) -> None:
        a, b, c, d = self.drive_rad
        self.controller.observe(Encoders(self.now_s, (a, b, c, d), angles_rad))

    def carry_out(self, action: Action, seconds: float) -> DriveOutput:
        for _ in range(round(seconds / TICK_S)):
            self.now_s += TICK_S
            output = self.controller.carry_out(permission(action), self.now_s)
            for i, speed in enumerate(output.modules.speeds_mps):
                self.drive_rad[i] += speed * TICK_S / ROBOT.wheel_radius_m
            self.observe(output.modules.angles_rad)
        return output


def permission(action: Action) -> Permission:
    return Permission(action, Command(FORWARD), EMPTY, ready=True, reason="")


def driving() -> Ride:
    ride = Ride()
    assert ride.carry_out(Action.DRIVE, 3.0).twist == FORWARD
    return ride


def test_braking_ignores_the_request_and_takes_the_emergency_deceleration() -> None:
    ride = driving()
    output = ride.carry_out(Action.BRAKE, 0.5 * STOPS_IN_S)
    assert output.twist.vx == pytest.approx(0.5, abs=0.1)
    assert ride.carry_out(Action.BRAKE, 0.5 * STOPS_IN_S + 2.0 * TICK_S).twist == ZERO_TWIST
    output = driving().carry_out(Action.HALT, TICK_S)
    assert (output.twist, set(output.modules.speeds_mps)) == (ZERO_TWIST, {0.0}), "a halt is zero at once"


def test_a_hard_stop_begins_between_two_steps_and_the_next_step_continues_it() -> None:
    ride = driving()
    begun = ride.controller.begin_braking(permission(Action.BRAKE), TICK_S, ride.now_s + 0.4 * TICK_S)
    assert begun is not None
    assert 0.0 < begun.twist.vx < 1.0
    ride.now_s += 0.4 * TICK_S
    assert ride.carry_out(Action.BRAKE, TICK_S).twist.vx < begun.twist.vx


def test_no_hard_stop_begins_without_one_due_or_at_rest_or_twice() -> None:
    ride = driving()
    assert ride.controller.begin_braking(permission(Action.DRIVE), TICK_S, ride.now_s) is None
    assert ride.controller.begin_braking(permission(Action.HALT), TICK_S, ride.now_s) is None
    assert ride.controller.begin_braking(permission(Action.BRAKE), TICK_S, ride.now_s) is not None
    assert ride.controller.begin_braking(permission(Action.BRAKE), TICK_S, ride.now_s) is None
    assert Ride().controller.begin_braking(permission(Action.BRAKE), TICK_S, 0.0) is None
