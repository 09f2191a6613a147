"""Parameters of the trajectory server, ``config/follow_joint_trajectory_server.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config, NotNegative, Positive
from robot_stack.wmx.api.values import MAX_IO_BYTES, MAX_SPLINE_DIMENSIONS
from robot_stack.wmx.session_params import LinkParams
from robot_stack.wmx.trajectory.goal import GoalLimits

Name = Annotated[str, Field(min_length=1)]
_BUSIEST_HZ = 500.0


class StartParams(Config):
    """Limits of a trajectory before it starts; see ``PlanLimits``. A limit of 0 means none, except for catching up."""

    same_position_rad: NotNegative
    max_deviation_rad: NotNegative
    max_velocity_radps: tuple[NotNegative, ...]
    max_acceleration_radps2: tuple[NotNegative, ...]
    max_delay_s: Positive
    catch_up_ratio: Annotated[float, Field(ge=1.0)]
    catch_up_acceleration_radps2: NotNegative


class SplineParams(Config):
    """Largest distance of the engine's spline from a curve with velocities between common points, and largest number
    of points.

    The distance is larger where no further point can be inserted: within two cycles, and near standstill, where the
    engine drops points that are too near each other. A jump of the acceleration by 100 rad/s^2 adds up to 0.1 mrad.
    """

    max_deviation_rad: Annotated[float, Field(ge=1e-5, le=0.1)]
    max_deviation_radps: Annotated[float, Field(ge=1e-3, le=1.0)]
    max_points: Annotated[int, Field(ge=100, le=20_000)]


class SpeedScalingParams(Config):
    """joint_trajectory_controller's name. Scales the time of every trajectory; never faster than requested."""

    initial_scaling_factor: Annotated[float, Field(ge=0.01, le=1.0)]


class PathParams(Config):
    """Default path tolerances of the joints. 0 is no limit."""

    position_rad: NotNegative


class GoalParams(Config):
    """Default tolerances at the end. 0 is no limit, of position and velocity."""

    position_rad: NotNegative
    stopped_velocity_radps: NotNegative
    time_s: Positive


class WatchParams(Config):
    """start_timeout_s: until a started motion shows. end_timeout_s: after the spline's time, until the engine is at its
    end. status_timeout_s: without a status. standstill_radps, standstill_s: joints stand if they are slower for this
    long. stop_timeout_s: in addition to the longest time of the spline's own stop; quick_stop_timeout_s: of the quick
    stop that is requested then.
    """

    start_timeout_s: Positive
    end_timeout_s: Positive
    status_timeout_s: Positive
    standstill_radps: Positive
    standstill_s: NotNegative
    stop_timeout_s: Positive
    quick_stop_timeout_s: Positive


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
    continuous_joints: tuple[Name, ...]
    start: StartParams
    spline: SplineParams
    speed_scaling: SpeedScalingParams
    path: PathParams
    goal: GoalParams
    watch: WatchParams
    link: LinkParams

    @model_validator(mode="after")
    def _consistent(self) -> TrajectoryServerParams:
        if len(self.joint_name) < self.joint_number:
            raise ValueError(f"joint_name: {len(self.joint_name)} names for joint_number {self.joint_number}")
        if len(set(self.joints)) != self.joint_number:
            raise ValueError("joint_name: names must differ")
        strangers = [name for name in self.continuous_joints if name not in self.joints]
        if strangers:
            raise ValueError(f"continuous_joints: {', '.join(strangers)} has no axis")
        if self.spline.max_points < self.max_points:
            raise ValueError("spline.max_points: must not be less than max_points, of a goal")
        for name in ("max_velocity_radps", "max_acceleration_radps2"):
            if len(getattr(self.start, name)) < self.joint_number:
                raise ValueError(f"start.{name}: must have a value for each of {self.joint_number} joints")
        return self

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints that have an axis, in the order of the axes."""
        return self.joint_name[: self.joint_number]


def goal_limits(params: TrajectoryServerParams) -> GoalLimits:
    return GoalLimits(
        joints=params.joints,
        max_points=params.max_points,
        max_start_delay_s=params.start.max_delay_s,
        path_position_rad=params.path.position_rad,
        goal_position_rad=params.goal.position_rad,
        goal_velocity_radps=params.goal.stopped_velocity_radps,
        goal_time_s=params.goal.time_s,
    )
