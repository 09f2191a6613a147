"""Parameters of the general node, ``config/wmx_ros2_general_node.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config, NotNegative, Positive
from robot_stack.wmx.api import MAX_AXES


class GeneralParams(Config):
    """The file documents each number."""

    axis_count: Annotated[int, Field(ge=1, le=MAX_AXES)]
    rated_torque_nm: tuple[Positive, ...]
    velocity_timeout_s: NotNegative
    max_velocity_radps: NotNegative
    max_acceleration_radps2: NotNegative
    command_max_wait_s: Positive
    device_attempts: Annotated[int, Field(ge=1)]
    device_retry_s: Positive
    probe_period_s: Positive
    communication_timeout_s: Positive
    servo_timeout_s: Positive
    alarm_timeout_s: Positive
    homing_timeout_s: Positive
    stop_timeout_s: Positive
    end_timeout_s: Positive
    stop_communication_at_exit: bool

    @model_validator(mode="after")
    def _one_torque_per_axis(self) -> GeneralParams:
        if len(self.rated_torque_nm) != self.axis_count:
            raise ValueError(
                f"rated_torque_nm must have axis_count = {self.axis_count} entries, has {len(self.rated_torque_nm)}"
            )
        return self
