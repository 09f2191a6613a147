"""Settings of an execution."""

from __future__ import annotations

from dataclasses import dataclass

from robot_stack.wmx.trajectory.params import TrajectoryServerParams, WatchParams
from robot_stack.wmx.trajectory.plan import PlanLimits


@dataclass(frozen=True, slots=True)
class ExecutionSettings:
    """joints: in the order of the axes."""

    joints: tuple[str, ...]
    plan: PlanLimits
    watch: WatchParams


def execution_settings(params: TrajectoryServerParams) -> ExecutionSettings:
    start = params.start
    plan = PlanLimits(
        same_position_rad=start.same_position_rad,
        max_start_deviation_rad=start.max_deviation_rad,
        max_velocity_radps=start.max_velocity_radps,
        max_acceleration_radps2=start.max_acceleration_radps2,
        catch_up_ratio=start.catch_up_ratio,
        catch_up_acceleration_radps2=start.catch_up_acceleration_radps2,
        near=params.spline,
        speed_scaling=params.speed_scaling.initial_scaling_factor,
        continuous=tuple(params.joints.index(name) for name in params.continuous_joints),
    )
    return ExecutionSettings(params.joints, plan, params.watch)
