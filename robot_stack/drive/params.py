"""Parameters of the swerve controller, ``config/swerve_controller.yaml``, and the kernel settings made of them and of
``config/robot.yaml``.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config
from robot_stack.core.robot import Robot
from robot_stack.drive.feasibility import ModuleLimits
from robot_stack.drive.kinematics import Positions
from robot_stack.drive.odometry import OdometrySettings
from robot_stack.drive.self_calibration import CalibrationSettings
from robot_stack.drive.swerve_drive import DriveSettings

Positive = Annotated[float, Field(gt=0.0)]
Share = Annotated[float, Field(gt=0.0, le=1.0)]
NotNegative = Annotated[float, Field(ge=0.0)]


class ModuleParams(Config):
    """Use of the modules. steering_share: of the steering's rate and acceleration; the rest is reserved for catching
    up. wheel_speed_share: of the drive's largest speed."""

    steering_share: Share
    wheel_speed_share: Share
    max_wheel_acceleration_mps2: Positive
    slip_tolerance_mps: Positive
    reversal_hysteresis_rad: Annotated[float, Field(ge=0.0, le=0.7)]


class DriveParams(Config):
    """Behaviour of the set point, see ``DriveSettings``."""

    emergency_yaw_deceleration_radps2: Positive
    align_tolerance_rad: Annotated[float, Field(gt=0.0, le=0.5)]
    align_timeout_s: Positive
    rest_speed_mps: NotNegative
    rest_yaw_rate_radps: NotNegative
    x_lock_after_s: Positive
    longest_step_s: Positive


class StandingParams(Config):
    """The robot stands when its measured twist is below both."""

    speed_mps: Positive
    yaw_rate_radps: Positive


class CalibrationParams(Config):
    """See ``CalibrationSettings``."""

    radius_deviation: Annotated[float, Field(gt=0.0, le=0.05)]
    zero_deviation_rad: Annotated[float, Field(gt=0.0, le=0.1)]
    noise_m: Positive
    least_way_m: Positive
    readings_per_update: Annotated[int, Field(ge=1)]


class OdometryParams(Config):
    """See ``OdometrySettings``."""

    shortest_interval_s: Positive
    longest_gap_s: Positive
    substep_s: Positive
    substep_turn_rad: Positive
    slip_speed_mps: Positive
    slip_share: Positive
    deviation_per_sqrt_m: Positive
    yaw_deviation_per_sqrt_m: Positive
    yaw_deviation_per_sqrt_rad: Positive
    slip_factor: Annotated[float, Field(ge=1.0)]
    twist_deviation_mps: Positive
    twist_deviation_radps: Positive
    calibration: CalibrationParams


class SwerveControllerParams(Config):
    """``config/swerve_controller.yaml``. assume_passenger: value until ``/passenger_attached`` is received."""

    assume_passenger: bool
    module: ModuleParams
    drive: DriveParams
    standing: StandingParams
    odometry: OdometryParams


def module_positions(robot: Robot) -> Positions:
    a, b, c, d = robot.module_positions_m()
    return a, b, c, d


def max_wheel_speed_mps(robot: Robot) -> float:
    """Speed of a wheel's rim at the drive's largest speed."""
    return robot.drive.max_speed_radps * robot.wheel_radius_m


def module_limits(params: ModuleParams, robot: Robot) -> ModuleLimits:
    return ModuleLimits(
        params.wheel_speed_share * max_wheel_speed_mps(robot),
        params.max_wheel_acceleration_mps2,
        params.steering_share * robot.steer.max_rate_radps,
        params.steering_share * robot.steer.max_acceleration_radps2,
        params.slip_tolerance_mps,
        params.reversal_hysteresis_rad,
    )


def drive_settings(params: DriveParams, robot: Robot) -> DriveSettings:
    return DriveSettings(
        robot.emergency_deceleration_mps2,
        params.emergency_yaw_deceleration_radps2,
        params.align_tolerance_rad,
        params.align_timeout_s,
        params.rest_speed_mps,
        params.rest_yaw_rate_radps,
        params.x_lock_after_s,
        params.longest_step_s,
    )


def odometry_settings(params: OdometryParams, robot: Robot) -> OdometrySettings:
    return OdometrySettings(
        wheel_radius_m=robot.wheel_radius_m,
        max_wheel_speed_mps=max_wheel_speed_mps(robot),
        max_steering_rate_radps=robot.steer.max_rate_radps,
        max_steering_acceleration_radps2=robot.steer.max_acceleration_radps2,
        calibration=CalibrationSettings(**params.calibration.model_dump()),
        **params.model_dump(exclude={"calibration"}),
    )
