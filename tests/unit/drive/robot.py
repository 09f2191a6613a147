"""The robot and the parameters shared by the tests of the drive."""

from __future__ import annotations

from robot_stack.core.config import load
from robot_stack.core.limits import MotionLimits
from robot_stack.core.robot import load_robot
from robot_stack.drive.params import SwerveControllerParams, module_limits, module_positions
from robot_stack.drive.swerve_drive import SwerveDrive

ROBOT = load_robot()
PARAMS = load(SwerveControllerParams, "swerve_controller")
POSITIONS = module_positions(ROBOT)
MODULE_LIMITS = module_limits(PARAMS.module, ROBOT)
EMPTY: MotionLimits = MotionLimits.of(ROBOT.empty)
WITH_PASSENGER: MotionLimits = MotionLimits.of(ROBOT.with_passenger)
TICK_S = 0.05


def new_drive() -> SwerveDrive:
    return SwerveDrive(PARAMS, ROBOT)
