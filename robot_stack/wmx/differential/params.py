"""Parameters of the differential drive, ``config/diff_drive_controller.yaml``, and the settings made of them.

The names without a unit are those of the interface documents.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from robot_stack.core.config import Config, Positive
from robot_stack.core.geometry import covariance_of_message
from robot_stack.core.limits import MotionLimits
from robot_stack.wmx.api import MAX_AXES
from robot_stack.wmx.differential.kinematics import BaseGeometry, WheelAxes
from robot_stack.wmx.session_params import Pause, SessionParams

Axis = Annotated[int, Field(ge=0, lt=MAX_AXES)]
NotNegative = Annotated[float, Field(ge=0.0, le=1e3)]
Polarity = Literal[1, -1]
Matrix3 = tuple[float, ...]
"""3 x 3, row-major."""
_UNSET = "no_param"
_UNLIMITED = 1e6  # m/s2, rad/s3 and the like: any command is reached within one step


class OdometryParams(Config):
    """shortest_interval_s: least time for the plausibility check. longest_gap_s: after a longer silence the way is
    unknown. deviation_per_sqrt_m: standard deviation of a wheel's way after one metre, m. twist_deviation_*: standard
    deviations of the measured twist.
    """

    shortest_interval_s: Positive
    longest_gap_s: Positive
    deviation_per_sqrt_m: Positive
    twist_deviation_mps: Positive
    twist_deviation_radps: Positive


class LimitParams(Config):
    """Limits of the body, combined so that a change of twist keeps its curve. 0 is no limit."""

    linear_acceleration_mps2: NotNegative
    angular_acceleration_radps2: NotNegative
    linear_jerk_mps3: NotNegative
    angular_jerk_radps3: NotNegative


class DiffDriveSessionParams(SessionParams):
    """follow_s: time after a command in which a wheel must reach velocity motion, and largest age of the status for a
    command, both in the engine's time. standstill_radps: a slower wheel stands. command_lifetime_s: timeout after
    which the engine itself stops wheels without a new command.
    """

    command_lifetime_s: Annotated[float, Field(gt=0.0, le=2.0)]
    follow_s: Pause
    standstill_radps: Positive


class DiffDriveParams(Config):
    """The whole file. rate: Hz. acc_time, dec_time: seconds of a change of velocity. wheel_radius, wheel_to_wheel: m.

    A topic name that is empty or ends in no_param has no publisher. wmx_param_file_path: absolute, or inside config/;
    empty or no_param skips it. end_timeout_s: how long the end waits for the wheels to stand.
    """

    left_axis: Axis
    right_axis: Axis
    rate: Annotated[float, Field(ge=1.0, le=1000.0)]
    acc_time: Pause
    dec_time: Pause
    wheel_radius: Annotated[float, Field(gt=0.0, le=10.0)]
    wheel_to_wheel: Annotated[float, Field(gt=0.0, le=100.0)]
    cmd_vel_topic: str
    encoder_vel_topic: str
    encoder_omega_topic: str
    encoder_odometry_topic: str
    wmx_param_file_path: str

    cmd_vel_stamped_topic: str
    cmd_vel_timeout_s: Annotated[float, Field(gt=0.0, le=10.0)]
    max_wheel_speed_radps: Positive
    limits: LimitParams
    left_polarity: Polarity
    right_polarity: Polarity
    odom_frame: str
    base_frame: str
    publish_pose: bool
    publish_tf: bool
    end_timeout_s: Positive
    odometry: OdometryParams
    session: DiffDriveSessionParams

    @model_validator(mode="after")
    def _consistent(self) -> DiffDriveParams:
        if self.left_axis == self.right_axis:
            raise ValueError(f"left_axis and right_axis must differ, both are {self.left_axis}")
        if self.publish_tf and not self.publish_pose:
            raise ValueError("publish_tf needs publish_pose: without a pose there is no transform")
        if not named(self.cmd_vel_topic):
            raise ValueError("cmd_vel_topic needs a name: the commands arrive on it")
        if self.publish_pose and not (self.odom_frame and self.base_frame):
            raise ValueError("odom_frame and base_frame need names with publish_pose")
        return self

    @property
    def axes(self) -> tuple[int, int]:
        """The engine's axes of the left and the right wheel."""
        return self.left_axis, self.right_axis


def named(value: str) -> bool:
    """The name of a topic or file if it is set."""
    return bool(value) and not value.endswith(_UNSET)


def base_geometry(params: DiffDriveParams) -> BaseGeometry:
    return BaseGeometry(radius_m=params.wheel_radius, track_m=params.wheel_to_wheel)


def wheel_axes(params: DiffDriveParams) -> WheelAxes:
    return WheelAxes(params.left_axis, params.right_axis, params.left_polarity, params.right_polarity)


def motion_limits(limits: LimitParams) -> MotionLimits | None:
    """None if nothing is limited. Speeds are limited at the wheels."""
    if not any(limits.model_dump().values()):
        return None
    return MotionLimits(
        speed_mps=_UNLIMITED,
        yaw_rate_radps=_UNLIMITED,
        acceleration_mps2=limits.linear_acceleration_mps2 or _UNLIMITED,
        yaw_acceleration_radps2=limits.angular_acceleration_radps2 or _UNLIMITED,
        jerk_mps3=limits.linear_jerk_mps3 or _UNLIMITED,
        yaw_jerk_radps3=limits.angular_jerk_radps3 or _UNLIMITED,
    )


def parameter_file(params: DiffDriveParams, config_folder: Path) -> str:
    """The engine's parameter XML, empty for none."""
    file = params.wmx_param_file_path
    return str(config_folder / file) if named(file) else ""


def twist_covariance(params: OdometryParams) -> list[float]:
    """6 x 6, row-major: measured forward speed and turning rate, and zero lateral slip."""
    forward, turning = params.twist_deviation_mps**2, params.twist_deviation_radps**2
    return covariance_of_message((forward, 0.0, 0.0, 0.0, forward, 0.0, 0.0, 0.0, turning))
