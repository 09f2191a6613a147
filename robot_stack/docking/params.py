"""Parameters of the docking controller, ``config/docking_controller.yaml``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from robot_stack.core.config import Config, NotNegative, Positive, Share


class TargetParams(Config):
    """Fusion of sightings and odometry to the dock's pose in odom."""

    history_s: Positive
    start_sigma_m: Positive
    start_sigma_rad: Positive
    least_sigma_m: Positive
    least_sigma_rad: Positive
    yaw_sigma_radpm: Positive
    odometry_m_per_sqrt_m: Positive
    odometry_rad_per_sqrt_m: Positive
    odometry_rad_per_sqrt_rad: Positive
    least_gain: Share
    jump_m: Positive
    jump_rad: Positive
    moved_after: Annotated[int, Field(ge=2)]
    moved_spread_m: Positive


class MotionParams(Config):
    """Speeds of the approach and the feedback around its reference."""

    along_mps: Positive
    across_mps: Positive
    turning_radps: Positive
    final_m: Positive
    final_mps: Positive
    acceleration_mps2: Positive
    acceleration_radps2: Positive
    jerk_mps3: Positive
    jerk_radps3: Positive
    position_gain_per_s: Positive
    yaw_gain_per_s: Positive
    max_correction_mps: Positive
    max_correction_radps: Positive
    wait_from_m: Positive
    wait_at_m: Positive
    wait_from_rad: Positive
    wait_at_rad: Positive
    max_extrapolation_s: NotNegative
    longest_step_s: Positive

    @model_validator(mode="after")
    def _waits_in_order(self) -> MotionParams:
        if self.wait_at_m <= self.wait_from_m or self.wait_at_rad <= self.wait_from_rad:
            raise ValueError("wait_at_* must be above wait_from_*")
        return self


class StagingParams(Config):
    """Driving to the staging pose, by navigation or backwards from a failed try."""

    distance_m: Positive
    arrival_m: Positive
    arrival_rad: Positive
    standing_mps: Positive
    standing_radps: Positive
    goal_retry_s: Positive
    timeout_s: Positive
    no_pose_s: Positive


class SearchParams(Config):
    """Looking for the markers."""

    look_s: Positive
    turning_radps: Positive
    timeout_s: Positive
    sightings: Annotated[int, Field(ge=1)]
    clear_m: Positive


class ServoParams(Config):
    """Servoing from the first sighting to the dock pose."""

    hold_after_s: Positive
    search_after_s: Positive
    timeout_s: Positive
    fine_timeout_s: Positive
    trusted_yaw_rad: Positive
    bearing_distance_m: Positive
    corridor_m: Positive
    corridor_rad: Positive
    aligned_m: Positive
    aligned_rad: Positive
    aligned_for_s: Positive
    rest_m: Positive
    rest_rad: Positive
    resume_m: Positive
    resume_rad: Positive

    @model_validator(mode="after")
    def _thresholds_in_order(self) -> ServoParams:
        if not self.rest_m < self.resume_m < self.aligned_m or not self.rest_rad < self.resume_rad < self.aligned_rad:
            raise ValueError("must be in order: rest_* < resume_* < aligned_*")
        if self.search_after_s <= self.hold_after_s:
            raise ValueError("search_after_s must be above hold_after_s")
        return self


class ContactParams(Config):
    """Detection of contact with the dock, by the wheels' force."""

    force_n: Positive
    time_constant_s: Positive
    watch_below_m: Positive
    settle_s: Positive


class LatchParams(Config):
    """Closing and opening the latch."""

    confirm_timeout_s: Positive
    charge_timeout_s: Positive
    charge_s: NotNegative
    learn_after_s: NotNegative
    learn_s: NotNegative
    learn_sightings: Annotated[int, Field(ge=1)]
    learn_share: Share
    largest_correction_m: Positive
    largest_correction_rad: Positive


class UndockParams(Config):
    """Backing off."""

    distance_m: Positive
    standing_mps: Positive
    standing_radps: Positive
    timeout_s: Positive
    blocked_s: Positive
    blocked_m: Positive
    follows_after_m: Positive
    follows_share: Share


class DockingParams(Config):
    """Everything in ``config/docking_controller.yaml``."""

    tries: Annotated[int, Field(ge=1, le=10)]
    try_timeout_s: Positive
    safety_hold_s: Positive
    odometry_timeout_s: Positive
    detections_timeout_s: Positive
    engine_poll_hz: Positive
    corrections_file: str
    language: Literal["en", "ja", "zh"]
    ehmi_volume: Annotated[int, Field(ge=0, le=10)]
    target: TargetParams
    motion: MotionParams
    staging: StagingParams
    search: SearchParams
    servo: ServoParams
    contact: ContactParams
    latch: LatchParams
    undock: UndockParams
