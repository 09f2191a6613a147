"""Parameters of the mission manager, ``config/mission_manager.yaml``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from robot_stack.core.config import Config, Positive


class MissionParams(Config):
    tick_rate_hz: Annotated[float, Field(ge=1.0, le=50.0)]
    status_rate_hz: Annotated[float, Field(ge=0.1, le=10.0)]
    position_tolerance_m: Annotated[float, Field(gt=0.0, le=1.0)]
    yaw_tolerance_rad: Annotated[float, Field(gt=0.0, le=1.0)]
    standstill_speed_mps: Annotated[float, Field(gt=0.0, le=0.2)]
    standstill_yaw_rate_radps: Annotated[float, Field(gt=0.0, le=0.2)]
    settle_s: Annotated[float, Field(ge=0.0, le=10.0)]
    pass_position_tolerance_m: Annotated[float, Field(gt=0.0, le=5.0)]
    pass_yaw_tolerance_rad: Annotated[float, Field(gt=0.0, le=3.2)]
    tries: Annotated[int, Field(ge=1, le=20)]
    progress_timeout_s: Annotated[float, Field(ge=0.0, le=600.0)]
    progress_reserve_s: Annotated[float, Field(ge=1.0, le=60.0)]
    progress_min_m: Annotated[float, Field(gt=0.0, le=1.0)]
    yaw_weight_m_per_rad: Positive
    goal_retry_s: Annotated[float, Field(ge=0.2, le=60.0)]
    docking_wait_s: Annotated[float, Field(ge=1.0, le=600.0)]
    docking_timeout_s: Annotated[float, Field(ge=1.0, le=3600.0)]
    docking_silence_s: Annotated[float, Field(ge=0.5, le=60.0)]
    docking_confirm_s: Annotated[float, Field(ge=0.2, le=60.0)]
    shown_waiting_after_s: Annotated[float, Field(gt=0.0, le=10.0)]
    announcement_s: Annotated[float, Field(ge=0.0, le=60.0)]
    eta_speed_time_constant_s: Positive
    next_order_after_s: Annotated[float, Field(ge=0.0, le=600.0)]
    localization_lost_s: Annotated[float, Field(ge=1.0, le=600.0)]
    minimum_battery: Annotated[float, Field(ge=0.0, le=1.0)]
    charged: Annotated[float, Field(ge=0.0, le=1.0)]
    home_radius_m: Positive
    language: Literal["en", "ja", "zh"]
    ehmi_volume: Annotated[int, Field(ge=0, le=10)]
    map: str
    missions_folder: str
    own_missions_folder: str
    journal_file: str

    def with_waits(self, longest_wait_s: float) -> MissionParams:
        """With a progress_timeout_s that outlasts navigation's longest wait, unless one is set."""
        timeout_s = self.progress_timeout_s or longest_wait_s + self.progress_reserve_s
        return self.model_copy(update={"progress_timeout_s": timeout_s})

    @model_validator(mode="after")
    def _charged_is_enough_for_a_mission(self) -> MissionParams:
        if self.charged < self.minimum_battery:
            raise ValueError("charged must not be below minimum_battery")
        return self

    @model_validator(mode="after")
    def _passing_is_looser(self) -> MissionParams:
        if self.pass_position_tolerance_m < self.position_tolerance_m:
            raise ValueError("pass_position_tolerance_m must not be below position_tolerance_m")
        if self.pass_yaw_tolerance_rad < self.yaw_tolerance_rad:
            raise ValueError("pass_yaw_tolerance_rad must not be below yaw_tolerance_rad")
        return self
