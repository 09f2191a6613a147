"""Parameters of the hardware interface, ``config/swerve_hardware_interface.yaml``, and what becomes of them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config
from robot_stack.core.robot import Robot
from robot_stack.drive.engine_session import SessionSettings
from robot_stack.drive.parameters import Positive, max_wheel_speed_mps
from robot_stack.drive.wheel_axes import AxisSettings


class SessionParams(Config):
    """See ``SessionSettings``."""

    absent_retry_s: Positive
    attempts: Annotated[int, Field(ge=1)]
    attempt_pause_s: Positive
    communication_retry_s: Positive
    request_pause_s: Positive
    feed_period_s: Positive
    watchdog_s: Annotated[float, Field(gt=0.0, le=10.0)]
    standstill_radps: Positive

    @model_validator(mode="after")
    def _fed_in_time(self) -> SessionParams:
        if self.feed_period_s >= 0.5 * self.watchdog_s:
            raise ValueError("feed_period_s must be below half of watchdog_s")
        return self


class SwerveHardwareParams(Config):
    """``config/swerve_hardware_interface.yaml``. end_timeout_s: how long the end waits for the wheels to stand."""

    max_wheel_acceleration_mps2: Positive
    steering_periods: Annotated[float, Field(ge=1.0, le=3.0)]
    end_timeout_s: Positive
    session: SessionParams


def session_settings(params: SessionParams) -> SessionSettings:
    return SessionSettings(**params.model_dump())


def axis_settings(params: SwerveHardwareParams, robot: Robot, command_rate_hz: float) -> AxisSettings:
    return AxisSettings(
        wheel_radius_m=robot.wheel_radius_m,
        max_wheel_speed_mps=max_wheel_speed_mps(robot),
        period_s=1.0 / command_rate_hz,
        max_wheel_acceleration_mps2=params.max_wheel_acceleration_mps2,
        stop_deceleration_mps2=robot.emergency_deceleration_mps2,
        max_steering_rate_radps=robot.steer.max_rate_radps,
        max_steering_acceleration_radps2=robot.steer.max_acceleration_radps2,
        steering_periods=params.steering_periods,
    )
