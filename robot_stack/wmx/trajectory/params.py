"""Parameters of the trajectory server, ``config/follow_joint_trajectory_server.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config
from robot_stack.wmx.api.values import MAX_IO_BYTES, MAX_SPLINE_DIMENSIONS
from robot_stack.wmx.trajectory.goal import GoalLimits
from robot_stack.wmx.trajectory.plan import PlanLimits
from robot_stack.wmx.trajectory.settings import ExecutionSettings

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Name = Annotated[str, Field(min_length=1)]
_BUSIEST_HZ = 500.0


class StartParams(Config):
    """What is asked of the way before it begins; see ``PlanLimits``. A limit of 0 is no limit."""

    same_position_rad: NotNegative
    max_deviation_rad: NotNegative
    max_velocity_radps: tuple[NotNegative, ...]
    max_acceleration_radps2: tuple[NotNegative, ...]
    max_delay_s: Positive


class GoalParams(Config):
    """What holds at the end where a goal says nothing. position_rad 0 is no limit."""

    position_rad: NotNegative
    time_s: Positive


class WatchParams(Config):
    """See ``ExecutionSettings``."""

    start_timeout_s: Positive
    end_timeout_s: Positive
    status_timeout_s: Positive
    standstill_radps: Positive
    standstill_s: NotNegative
    stop_timeout_s: Positive
    quick_stop_timeout_s: Positive


class LinkParams(Config):
    """See ``EngineLink``."""

    retry_s: Positive
    feed_period_s: Positive
    watchdog_s: Annotated[float, Field(gt=0.0, le=10.0)]


class TrajectoryServerParams(Config):
    """The whole file. Joint j is the engine's axis j; names beyond ``joint_number`` (gripper fingers) have no axis."""

    joint_number: Annotated[int, Field(ge=1, le=MAX_SPLINE_DIMENSIONS)]
    joint_name: tuple[Name, ...]
    joint_trajectory_action: Name
    wmx_gripper_topic: Name
    gripper_output_byte: Annotated[int, Field(ge=0, lt=MAX_IO_BYTES)]
    gripper_output_bit: Annotated[int, Field(ge=0, lt=8)]
    max_points: Annotated[int, Field(ge=2, le=1000)]
    poll_rate_hz: Annotated[float, Field(ge=100.0, le=_BUSIEST_HZ)]
    feedback_rate_hz: Annotated[float, Field(gt=0.0, le=_BUSIEST_HZ)]
    start: StartParams
    goal: GoalParams
    watch: WatchParams
    link: LinkParams

    @model_validator(mode="after")
    def _consistent(self) -> TrajectoryServerParams:
        if len(self.joint_name) < self.joint_number:
            raise ValueError(f"joint_name: {len(self.joint_name)} names for joint_number {self.joint_number}")
        if len(set(self.joints)) != self.joint_number:
            raise ValueError("joint_name: names must differ")
        for name in ("max_velocity_radps", "max_acceleration_radps2"):
            if len(getattr(self.start, name)) < self.joint_number:
                raise ValueError(f"start.{name}: must have a value for each of {self.joint_number} joints")
        if self.link.feed_period_s >= 0.5 * self.link.watchdog_s:
            raise ValueError("link.feed_period_s must be below half of link.watchdog_s")
        return self

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints that have an axis, in the order of the axes."""
        return self.joint_name[: self.joint_number]


def goal_limits(params: TrajectoryServerParams) -> GoalLimits:
    return GoalLimits(
        params.joints, params.max_points, params.start.max_delay_s, params.goal.position_rad, params.goal.time_s
    )


def execution_settings(params: TrajectoryServerParams) -> ExecutionSettings:
    start = params.start
    return ExecutionSettings(
        joints=params.joints,
        plan=PlanLimits(
            start.same_position_rad, start.max_deviation_rad, start.max_velocity_radps, start.max_acceleration_radps2
        ),
        **params.watch.model_dump(),
    )
