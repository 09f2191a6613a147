"""Parameters of the safety nodes: ``config/safety_monitor.yaml`` and ``config/emergency_stop_button.yaml``.

The timeouts of topics are the ``stale_s`` of the contract's rows.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, field_validator, model_validator

from robot_stack.contract import faults, processes
from robot_stack.core.config import Config, Fraction, Positive
from robot_stack.safety.computer_params import ComputerParams, LinkParams
from robot_stack.safety.obstacle_params import CollisionParams, LidarParams, ObstacleParams, PedestrianCollisionParams

Degrees = Annotated[float, Field(gt=0.0, lt=90.0)]


class DescentParams(Config):
    """Driving off a slope above ``slope_stop_deg``: speed limits, and tolerance of the course to the fall line.

    angle_deg: largest angle of the robot's course to the fall line; angle_hysteresis_deg: added once under way.
    ask_again_s: after a refused motion a standing robot accepts another request after this time.
    """

    max_speed_mps: Positive
    max_yaw_rate_radps: Positive
    angle_deg: Degrees
    angle_hysteresis_deg: Degrees
    ask_again_s: Positive

    @model_validator(mode="after")
    def _leads_down(self) -> DescentParams:
        if not self.angle_deg + self.angle_hysteresis_deg < 90.0:
            raise ValueError("angle_deg + angle_hysteresis_deg must be less than 90: greater angles do not lead down")
        return self


class StopSourceParams(Config):
    """Sources of the emergency stop. explain_s: largest time between a true on ``/emergency_stop`` and the report of
    its source, discovery_s: the same for the first report of a process. button_silence_s: timeout of the reports of
    the button's process.
    """

    explain_s: Positive
    discovery_s: Positive
    button_silence_s: Positive


class SteeringParams(Config):
    """A module counts as stuck if, for longer than hold_s while the robot rolls, its error exceeds angle_rad: measured
    to commanded heading, or disagreement_mps: velocity of a wheel to the least-squares motion of all of them.
    """

    angle_rad: Annotated[float, Field(gt=0.0, lt=1.5)]
    disagreement_mps: Positive
    hold_s: Positive


class DockParams(Config):
    """A speed limit at a dock."""

    max_speed_mps: Positive
    max_yaw_rate_radps: Positive


class OverspeedParams(Config):
    """Criteria of overspeed. hold_s: faster than permitted for longer than this. margin: added to the permitted speed,
    for measurement noise. notice_s: until the drive begins to brake; the time of a jerk limit is added.
    deceleration_share: share of the drive's deceleration with which the permitted speed falls.
    """

    hold_s: Positive
    margin_mps: Positive
    margin_radps: Positive
    notice_s: Positive
    deceleration_share: Annotated[float, Field(gt=0.0, le=1.0)]


class SafetyParams(Config):
    """Parameters of the safety monitor. Every comparison is strict: a value equal to its limit is still allowed."""

    tick_hz: Annotated[float, Field(ge=20.0, le=500.0)]
    rows: tuple[str, ...]
    expected_processes: tuple[str, ...]
    startup_grace_s: Positive
    startup_settle_s: Positive

    drive_silence_s: Positive
    drive_servo_off_s: Positive
    drive_servo_on_timeout_s: Positive

    latch_write_s: Positive
    release_settle_s: Positive
    standstill_mps: Positive
    standstill_hold_s: Positive
    button_debounce_s: Annotated[float, Field(gt=0.0, le=0.05)]

    stop_sources: StopSourceParams
    overspeed: OverspeedParams
    steering: SteeringParams
    undocking: DockParams
    docking: DockParams

    tilt_stop_deg: Degrees
    tilt_clear_deg: Degrees
    slope_limit_deg: Degrees
    slope_stop_deg: Degrees
    slope_tolerance_deg: Degrees
    slope_hysteresis_deg: Degrees

    attitude_time_constant_s: Positive
    attitude_settle_s: Positive
    attitude_max_gap_s: Positive
    kinematic_filter_s: Positive
    kinematic_max_mps2: Positive
    imu_min_mps2: Positive
    imu_max_mps2: Positive
    imu_max_radps: Positive

    lost_quality: Fraction
    found_quality: Fraction
    pose_jump_m: Positive

    battery_low: Fraction
    battery_critical: Fraction
    battery_hysteresis: Annotated[float, Field(gt=0.0, lt=0.5)]

    slope_limit_mps: Positive
    slope_limit_radps: Positive
    descent: DescentParams
    degraded_limit_mps: Positive
    degraded_limit_radps: Positive

    collision: CollisionParams
    pedestrian_collision: PedestrianCollisionParams
    obstacles: ObstacleParams
    lidar: LidarParams
    overhead_lidar: LidarParams
    computer: ComputerParams
    links: LinkParams

    @field_validator("rows")
    @classmethod
    def _rows_can_be_evaluated(cls, rows: tuple[str, ...]) -> tuple[str, ...]:
        _unique(rows)
        for code in rows:
            if code not in faults.BY_CODE:
                raise ValueError(f"{code} is not a fault of the contract")
        if "ESTOP_PRESSED" not in rows:
            raise ValueError("ESTOP_PRESSED must be among the rows: the monitor must handle the emergency stop")
        return rows

    @field_validator("expected_processes")
    @classmethod
    def _processes_exist(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        _unique(names)
        for name in names:
            if name not in processes.BY_NAME:
                raise ValueError(f"{name} is not a process of the contract")
        if "safety_monitor" in names:
            raise ValueError("safety_monitor cannot watch itself")
        return names

    @model_validator(mode="after")
    def _limits_are_ordered(self) -> SafetyParams:
        for smaller, greater in _ORDERED:
            if not getattr(self, smaller) < getattr(self, greater):
                raise ValueError(f"{smaller} must be less than {greater}")
        if not self.slope_stop_deg + self.slope_tolerance_deg + self.slope_hysteresis_deg < self.tilt_stop_deg:
            raise ValueError("slope_stop_deg with its tolerance and hysteresis must be less than tilt_stop_deg")
        return self


class ButtonParams(Config):
    """Parameters of reading the button."""

    poll_hz: Annotated[float, Field(ge=200.0, le=1000.0)]
    debounce_s: Annotated[float, Field(gt=0.0, le=0.05)]
    silence_s: Annotated[float, Field(gt=0.0, le=0.5)]
    startup_settle_s: Annotated[float, Field(gt=0.0, le=60.0)]


_ORDERED = (
    ("slope_hysteresis_deg", "slope_limit_deg"),
    ("slope_limit_deg", "slope_stop_deg"),
    ("slope_stop_deg", "tilt_stop_deg"),
    ("tilt_clear_deg", "tilt_stop_deg"),
    ("imu_min_mps2", "imu_max_mps2"),
    ("attitude_max_gap_s", "attitude_time_constant_s"),
    ("lost_quality", "found_quality"),
    ("battery_critical", "battery_low"),
)


def _unique(names: tuple[str, ...]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"{name} is listed twice")
