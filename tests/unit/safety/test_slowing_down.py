"""Monitor and drive together: the drive follows a falling limit within the acceleration and jerk of a ride."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.core.config import load
from robot_stack.core.geometry import Twist2
from robot_stack.core.limits import MotionLimits
from robot_stack.drive.arbitration import Command, Source
from robot_stack.drive.controller import SwerveController
from robot_stack.drive.odometry import Encoders
from robot_stack.drive.params import SwerveControllerParams
from robot_stack.drive.permission import Situation, permit
from tests.unit.safety.story import PARAMS, ROBOT, TICK_S, Story

P = PARAMS.collision
LIMITS = MotionLimits.of(ROBOT.empty), MotionLimits.of(ROBOT.with_passenger)
DRIVE_TICKS = 5  # of the monitor in one of the drive's
ACROSS_M = np.arange(-1.5, 1.51, 0.05)


def drive_towards(ends: str, carried: bool, wanted_mps: float) -> tuple[float, float]:
    """Drives until the robot stands or is at the end of what it knows, 6 m ahead at first. Returns the way left, m, and
    the speed, m/s.
    """
    story = Story().healthy()
    footprint = ROBOT.footprint_with_chair if carried else ROBOT.footprint
    story.carry(carried).run(1.0)
    controller = SwerveController(load(SwerveControllerParams, "swerve_controller"), ROBOT)
    story.request = Twist2(wanted_mps, 0.0, 0.0)
    left_m, wheel_rad, speed, before, target = 6.0, 0.0, 0.0, 0.0, 0.0
    for tick in range(2000):
        speed = before + (target - before) * (tick % DRIVE_TICKS + 1) / DRIVE_TICKS
        left_m -= speed * TICK_S
        wheel_rad += speed * TICK_S / ROBOT.wheel_radius_m
        points = np.stack([np.full_like(ACROSS_M, footprint.front_m + left_m), ACROSS_M, 0.0 * ACROSS_M], axis=1)
        setattr(story, ends, points.astype(np.float32))
        story.wheel_radps, story.driven = speed / ROBOT.wheel_radius_m, controller.set_point
        story.tick()
        if left_m <= 0.0 or (tick > 500 and speed == 0.0):
            break
        if tick % DRIVE_TICKS == DRIVE_TICKS - 1:
            controller.observe(Encoders(story.now_s, (wheel_rad,) * 4, (0.0,) * 4))
            situation = Situation(
                story.monitor.emergency,
                True,
                True,
                story.verdict.limit,
                True,
                carried,
                Source.NAVIGATION,
                Command(story.request),
            )
            before, target = target, controller.carry_out(permit(situation, *LIMITS), story.now_s).twist.vx
    return left_m, speed


def test_robot_with_passenger_stands_before_the_end_of_known_ground() -> None:
    left_m, speed_mps = drive_towards("no_ground", True, 1.0)
    assert speed_mps == 0.0
    assert P.ground_margin_m <= left_m < P.ground_margin_m + 0.05


@pytest.mark.parametrize(("carried", "wanted_mps"), [(True, 1.0), (False, 1.5)])
def test_robot_is_slow_at_the_end_of_the_seen_space(carried: bool, wanted_mps: float) -> None:
    left_m, speed_mps = drive_towards("unseen", carried, wanted_mps)
    assert left_m <= 0.0
    assert speed_mps == pytest.approx(P.unseen_mps, abs=0.01)
