"""Parameters of the hardware interface, ``config/swerve_hardware_interface.yaml``, and the settings made of them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.contract import topics
from robot_stack.contract.frames import DRIVE_AXES, STEER_AXES
from robot_stack.core.config import Config, Positive
from robot_stack.core.robot import Robot
from robot_stack.drive.params import max_wheel_speed_mps
from robot_stack.drive.wheel_axes import AxisSettings
from robot_stack.wmx.session_params import SessionParams

_COMMAND_STALE_S = topics.WHEEL_COMMANDS.stale_limit_s


class DriveSessionParams(SessionParams):
    """standstill_radps: a slower wheel stands."""

    standstill_radps: Positive


class SwerveHardwareParams(Config):
    """``config/swerve_hardware_interface.yaml``. command_lifetime_s: timeout after which the engine itself stops wheels
    without a new command. softest_slowing_mps2: see ``AxisSettings``. end_timeout_s: longest wait for standstill at
    the end.
    """

    max_wheel_acceleration_mps2: Positive
    steering_periods: Annotated[float, Field(ge=1.0, le=3.0)]
    command_lifetime_s: Annotated[float, Field(gt=0.0, le=0.5)]
    softest_slowing_mps2: Annotated[float, Field(ge=0.5)]
    end_timeout_s: Positive
    session: DriveSessionParams

    @model_validator(mode="after")
    def _silence_is_answered_here_first(self) -> SwerveHardwareParams:
        if self.command_lifetime_s <= _COMMAND_STALE_S:
            raise ValueError(f"command_lifetime_s must be above {_COMMAND_STALE_S}: the node handles shorter timeouts")
        return self


def axis_settings(params: SwerveHardwareParams, robot: Robot, command_rate_hz: float) -> AxisSettings:
    axes = robot.joint_axes
    return AxisSettings(
        drive_axes=tuple(axes[joint] for joint in DRIVE_AXES),
        steer_axes=tuple(axes[joint] for joint in STEER_AXES),
        wheel_radius_m=robot.wheel_radius_m,
        max_wheel_speed_mps=max_wheel_speed_mps(robot),
        period_s=1.0 / command_rate_hz,
        max_wheel_acceleration_mps2=params.max_wheel_acceleration_mps2,
        stop_deceleration_mps2=robot.emergency_deceleration_mps2,
        max_steering_rate_radps=robot.steer.max_rate_radps,
        max_steering_acceleration_radps2=robot.steer.max_acceleration_radps2,
        steering_periods=params.steering_periods,
        command_lifetime_s=params.command_lifetime_s,
        softest_slowing_mps2=params.softest_slowing_mps2,
    )
