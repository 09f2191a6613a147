"""Parameters of the node ndt_localization, ``config/ndt_localization.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config, NotNegative, Positive, Share
from robot_stack.localization.ndt.params import NdtParams


class OdometryParams(Config):
    """Variances of the increments of ``/odom``, beside the covariance in the messages."""

    position_growth_m_per_sqrt_m: NotNegative
    yaw_growth_rad_per_sqrt_m: NotNegative
    yaw_growth_rad_per_sqrt_rad: NotNegative
    max_gap_s: Positive
    max_speed_factor: Annotated[float, Field(ge=1.0)]
    jump_tolerance_m: Positive
    jump_tolerance_rad: Positive
    clock_restart_s: Positive


class GyroParams(Config):
    """The yaw gyro.

    Between samples farther apart than ``hold_s`` the turn is unknown; in shorter gaps, where samples were lost, the
    rate may have changed by ``gap_acceleration_radps2``.
    """

    noise_radps: Positive
    bias_sigma_radps: Positive
    bias_walk_radps_per_sqrt_s: NotNegative
    max_rate_radps: Positive
    period_s: Positive
    hold_s: Positive
    gap_acceleration_radps2: Positive
    frozen_samples: Annotated[int, Field(ge=2)]
    disagreement_sigmas: Positive


class StandstillParams(Config):
    """When the robot counts as standing, so that the gyro measures only its bias."""

    after_s: Positive
    max_speed_mps: Positive
    max_yaw_rate_radps: Positive
    max_gyro_radps: Positive


class QualityParams(Config):
    """The scale of ``/localization/quality``, see :func:`robot_stack.localization.quality.quality`."""

    position_half_sigma_m: Positive
    yaw_half_sigma_rad: Positive
    without_gyro_factor: Share
    odometry_fresh_s: Positive
    odometry_silent_s: Positive

    @model_validator(mode="after")
    def _fresh_before_silent(self) -> QualityParams:
        if self.odometry_fresh_s >= self.odometry_silent_s:
            raise ValueError("odometry_fresh_s must be smaller than odometry_silent_s")
        return self


class LocalizationParams(Config):
    """All parameters of the node.

    map: name of a folder in config/maps, or its path; empty: odometry and gyro alone.
    """

    map: str
    start_x_m: float
    start_y_m: float
    start_yaw_rad: float
    start_position_sigma_m: Positive
    start_yaw_sigma_rad: Positive
    correction_gate_sigmas: Positive
    history_s: Positive
    odometry: OdometryParams
    gyro: GyroParams
    standstill: StandstillParams
    quality: QualityParams
    ndt: NdtParams
