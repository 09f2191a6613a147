"""Planning limits: those of robot, passenger and safety monitor, less a reserve for the feedback."""

from __future__ import annotations

from dataclasses import dataclass

from robot_stack.core.limits import MotionLimits, SpeedLimit
from robot_stack.core.robot import Motion
from robot_stack.navigation.params import LimitParams


@dataclass(frozen=True, slots=True)
class PlanningLimits:
    """Limits of a plan: ``cruise`` everywhere; a robot faster than that slows down within ``braking``.

    The drive brakes to a lowered limit at its largest deceleration; a slower plan would run ahead of the robot.
    max_turning_mps2: largest product of speed and yaw rate. In the frame of a turning body a straight course turns,
    which takes part of the drive's acceleration.
    """

    cruise: MotionLimits
    braking: MotionLimits
    max_turning_mps2: float


def planning_limits(motion: Motion, limit: SpeedLimit, params: LimitParams) -> PlanningLimits | None:
    """The limits to plan with; None if the speed limit is too low to drive: then the robot stands."""
    speed_mps, yaw_rate_radps = limit.usable()
    speed_mps = min(motion.max_speed_mps, params.cruise_speed_mps, speed_mps)
    yaw_rate_radps = min(motion.max_yaw_rate_radps, yaw_rate_radps)
    if speed_mps < params.stop_below_mps or yaw_rate_radps < params.stop_below_mps:
        return None
    speed_mps, yaw_rate_radps = params.speed_share * speed_mps, params.speed_share * yaw_rate_radps
    return PlanningLimits(
        cruise=_limits(motion, speed_mps, yaw_rate_radps, params.acceleration_share, params.jerk_share),
        braking=_limits(motion, speed_mps, yaw_rate_radps, 1.0, 1.0),
        max_turning_mps2=params.turning_share * motion.max_acceleration_mps2,
    )


def _limits(
    motion: Motion, speed_mps: float, yaw_rate_radps: float, acceleration_share: float, jerk_share: float
) -> MotionLimits:
    return MotionLimits(
        speed_mps,
        yaw_rate_radps,
        acceleration_share * motion.max_acceleration_mps2,
        acceleration_share * motion.max_yaw_acceleration_radps2,
        jerk_share * motion.max_jerk_mps3,
        jerk_share * motion.max_yaw_jerk_radps3,
    )
