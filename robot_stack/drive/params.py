"""Parameters of the swerve controller, ``config/swerve_controller.yaml``, and the module limits made of them and of
``config/robot.yaml``.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config, NotNegative, Positive, Share
from robot_stack.core.robot import Robot
from robot_stack.drive.feasibility import ModuleLimits
from robot_stack.drive.kinematics import Positions


class ModuleParams(Config):
    """Use of the modules. steering_share: of the steering's rate and acceleration; the rest is reserved for catching
    up. wheel_speed_share: of the drive's largest speed."""

    steering_share: Share
    wheel_speed_share: Share
    max_wheel_acceleration_mps2: Positive
    slip_tolerance_mps: Positive
    reversal_hysteresis_rad: Annotated[float, Field(ge=0.0, le=0.7)]


class DriveParams(Config):
    """Behaviour of the set point.

    emergency_yaw_deceleration_radps2: while braking.
    align_tolerance_rad: a standing robot starts when every heading is this near.
    align_timeout_s: after this long, modules that are still off are named as stuck.
    rest_speed_mps, rest_yaw_rate_radps: smaller commands are none.
    x_lock_after_s: time at rest after which the wheels cross.
    longest_step_s: longer steps are taken as this long, so that a late tick makes no leap.
    """

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
    """radius_deviation, zero_deviation_rad: standard deviations among machines. noise_m: of one row of one reading.
    least_way_m: of the fastest wheel; smaller readings are not used. readings_per_update: between two estimates.
    """

    radius_deviation: Annotated[float, Field(gt=0.0, le=0.05)]
    zero_deviation_rad: Annotated[float, Field(gt=0.0, le=0.1)]
    noise_m: Positive
    least_way_m: Positive
    readings_per_update: Annotated[int, Field(ge=1)]


class OdometryParams(Config):
    """shortest_interval_s: plausibility and speeds are computed over at least this time, because stamps jitter.
    longest_gap_s: after a longer gap the distance is rejected, because the encoders may have been reset.
    substep_s, substep_turn_rad: longer intervals and larger turns of a module are cut into even parts.
    slip_speed_mps, slip_share: wheels are inconsistent if they differ by more than this speed plus this share of
    the fastest wheel's.
    deviation_per_sqrt_m, yaw_deviation_per_sqrt_m, yaw_deviation_per_sqrt_rad: growth of the standard deviations, m and
        rad; slip_factor: multiplies their growth while wheels are inconsistent.
    twist_deviation_mps, twist_deviation_radps: standard deviations of a twist that all wheels agree on.
    """

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
