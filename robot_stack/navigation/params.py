"""Parameters of the navigation controller, ``config/navigation_controller.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Share = Annotated[float, Field(gt=0.0, le=1.0)]


class LimitParams(Config):
    """How much of the robot's limits (``config/robot.yaml``) a plan uses; the rest is left to the feedback."""

    cruise_speed_mps: Positive
    speed_share: Share
    acceleration_share: Share
    jerk_share: Share
    turning_share: Share
    stop_below_mps: Positive


class GoalParams(Config):
    """Which goals are taken, and when one is reached."""

    max_distance_m: Positive
    max_age_s: Positive
    position_tolerance_m: Positive
    yaw_tolerance_rad: Positive
    settled_position_m: Positive
    settled_yaw_rad: Positive
    settle_s: Positive
    arrival_speed_mps: Positive
    arrival_yaw_rate_radps: Positive

    @model_validator(mode="after")
    def _settled_is_tighter(self) -> GoalParams:
        for settled, tolerance in (
            ("settled_position_m", "position_tolerance_m"),
            ("settled_yaw_rad", "yaw_tolerance_rad"),
        ):
            if getattr(self, settled) >= getattr(self, tolerance):
                raise ValueError(f"{settled} must be smaller than {tolerance}")
        return self


class TrackingParams(Config):
    """Feedback and feed-forward."""

    command_delay_s: NotNegative
    position_gain_per_s: Positive
    yaw_gain_per_s: Positive
    max_correction_mps: Positive
    max_correction_radps: Positive
    start_ahead_s: Positive
    start_moved_m: Positive
    start_moved_rad: Positive
    start_timeout_s: Positive
    wait_from_m: Positive
    wait_at_m: Positive
    wait_from_rad: Positive
    wait_at_rad: Positive
    replan_position_m: Positive
    replan_yaw_rad: Positive
    replan_interval_s: Positive
    max_step_s: Positive

    @model_validator(mode="after")
    def _waits_before_it_plans_afresh(self) -> TrackingParams:
        if not self.wait_from_m < self.wait_at_m < self.replan_position_m:
            raise ValueError("wait_from_m < wait_at_m < replan_position_m must hold")
        if not self.wait_from_rad < self.wait_at_rad < self.replan_yaw_rad:
            raise ValueError("wait_from_rad < wait_at_rad < replan_yaw_rad must hold")
        return self


class PoseParams(Config):
    """How long what is known of the pose may be used."""

    pose_timeout_s: Positive
    odometry_timeout_s: Positive
    max_extrapolation_s: Positive
    history_s: Positive
    max_speed_factor: Annotated[float, Field(ge=1.0)]
    jump_tolerance_m: Positive
    jump_tolerance_rad: Positive


class NavigationParams(Config):
    """Everything the node can be told."""

    plan_spacing_m: Positive
    plan_max_poses: Annotated[int, Field(ge=2)]
    standing_speed_mps: Positive
    standing_yaw_rate_radps: Positive
    limits: LimitParams
    goal: GoalParams
    tracking: TrackingParams
    pose: PoseParams
