"""The robot and the parameters shared by the tests of the drive."""

from __future__ import annotations

from robot_stack.core.config import load
from robot_stack.core.limits import MotionLimits
from robot_stack.core.robot import load_robot
from robot_stack.drive.params import (
    SwerveControllerParams,
    drive_settings,
    module_limits,
    module_positions,
    odometry_settings,
)
from robot_stack.drive.swerve_drive import SwerveDrive

ROBOT = load_robot()
PARAMS = load(SwerveControllerParams, "swerve_controller")
POSITIONS = module_positions(ROBOT)
MODULE_LIMITS = module_limits(PARAMS.module, ROBOT)
DRIVE_SETTINGS = drive_settings(PARAMS.drive, ROBOT)
ODOMETRY_SETTINGS = odometry_settings(PARAMS.odometry, ROBOT)
EMPTY: MotionLimits = MotionLimits.of(ROBOT.empty)
WITH_PASSENGER: MotionLimits = MotionLimits.of(ROBOT.with_passenger)
TICK_S = 0.05


def new_drive() -> SwerveDrive:
    return SwerveDrive(POSITIONS, MODULE_LIMITS, DRIVE_SETTINGS)
