"""Parameters of the safety nodes: ``config/safety_monitor.yaml`` and ``config/emergency_stop_button.yaml``.

The time-outs of topics are not here: they are the ``stale_s`` of the contract's rows.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, field_validator, model_validator

from robot_stack.contract import faults, processes
from robot_stack.core.config import Config
from robot_stack.safety.conditions import CONDITIONS
from robot_stack.safety.obstacle_params import CollisionParams, LidarParams, ObstacleParams

Positive = Annotated[float, Field(gt=0.0)]
Degrees = Annotated[float, Field(gt=0.0, lt=90.0)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]


class SafetyParams(Config):
    """What the safety monitor judges by. Every comparison is strict: a value equal to its limit is still allowed."""

    tick_hz: Annotated[float, Field(ge=20.0, le=500.0)]
    rows: tuple[str, ...]
    expected_processes: tuple[str, ...]
    startup_grace_s: Positive
    startup_settle_s: Positive

    drive_silence_s: Positive
    drive_servo_off_s: Positive
    drive_servo_on_timeout_s: Positive

    release_settle_s: Positive
    standstill_mps: Positive
    standstill_hold_s: Positive

    tilt_stop_deg: Degrees
    tilt_clear_deg: Degrees
    slope_limit_deg: Degrees
    slope_stop_deg: Degrees
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
    degraded_limit_mps: Positive
    degraded_limit_radps: Positive

    collision: CollisionParams
    obstacles: ObstacleParams
    lidar: LidarParams

    @field_validator("rows")
    @classmethod
    def _rows_can_be_evaluated(cls, rows: tuple[str, ...]) -> tuple[str, ...]:
        _unique(rows)
        for code in rows:
            if code not in faults.BY_CODE:
                raise ValueError(f"{code} is not a fault of the contract")
            if code not in CONDITIONS:
                raise ValueError(f"{code} has no condition yet; there are {', '.join(CONDITIONS)}")
        if "ESTOP_PRESSED" not in rows:
            raise ValueError("ESTOP_PRESSED must be among the rows: a monitor that ignores the emergency stop is none")
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
        return self


class ButtonParams(Config):
    """How the button is read."""

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
