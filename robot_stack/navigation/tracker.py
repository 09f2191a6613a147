"""Velocity commands that keep the body on its planned motion.

Feed-forward: the planned velocity, ahead in time by the delay of a command. Feedback: proportional to the
error of the pose now.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_stack.core.geometry import Pose2, Twist2, wrap_angle
from robot_stack.core.limits import MotionLimits
from robot_stack.navigation.motion import MotionState
from robot_stack.navigation.params import TrackingParams


@dataclass(frozen=True, slots=True)
class TrackingError:
    """Planned pose minus estimated pose: along map x and y in m, yaw in rad."""

    x: float
    y: float
    yaw: float

    def distance_m(self) -> float:
        return math.hypot(self.x, self.y)


def tracking_error(planned: Pose2, pose: Pose2) -> TrackingError:
    return TrackingError(planned.x - pose.x, planned.y - pose.y, wrap_angle(planned.yaw - pose.yaw))


def waiting_rate(now: MotionState, pose: Pose2, params: TrackingParams) -> float:
    """Rate of the plan's time, 0..1: the plan waits for a robot that is held back.

    Only the lag along the way counts; the feedback corrects the lateral error.
    """
    error, speed = tracking_error(now.pose, pose), now.speed()
    behind_m = (error.x * now.velocity[0] + error.y * now.velocity[1]) / speed if speed > 0.0 else 0.0
    behind_rad = math.copysign(error.yaw, now.yaw_rate * error.yaw) if now.yaw_rate else 0.0
    return min(
        _share(behind_m, params.wait_from_m, params.wait_at_m),
        _share(behind_rad, params.wait_from_rad, params.wait_at_rad),
    )


def begun(start: MotionState, soon: MotionState, pose: Pose2, params: TrackingParams) -> bool:
    """True once a robot that starts from rest has moved in the direction of the plan."""
    course = math.hypot(*soon.velocity)
    moved_x, moved_y = pose.x - start.pose.x, pose.y - start.pose.y
    along_m = (moved_x * soon.velocity[0] + moved_y * soon.velocity[1]) / course if course > 0.0 else 0.0
    turned_rad = math.copysign(1.0, soon.yaw_rate) * wrap_angle(pose.yaw - start.pose.yaw)
    return along_m > params.start_moved_m or (soon.yaw_rate != 0.0 and turned_rad > params.start_moved_rad)


def _share(value: float, full: float, none: float) -> float:
    return min(1.0, max(0.0, (none - value) / (none - full)))


def command(now: MotionState, ahead: MotionState, pose: Pose2, params: TrackingParams, rate: float = 1.0) -> Twist2:
    """The twist to command, base_link.

    now: planned state now. ahead: planned state when the command acts. pose: estimated pose now, map.
    rate: of the plan's time.
    """
    error = tracking_error(now.pose, pose)
    pull_x, pull_y = _bounded(error.x, error.y, params.position_gain_per_s, params.max_correction_mps)
    pull_yaw = max(-params.max_correction_radps, min(params.max_correction_radps, params.yaw_gain_per_s * error.yaw))
    # Predicted yaw when the command acts, if the body turns as planned.
    yaw = pose.yaw + wrap_angle(ahead.pose.yaw - now.pose.yaw)
    c, s = math.cos(yaw), math.sin(yaw)
    vx, vy = rate * ahead.velocity[0] + pull_x, rate * ahead.velocity[1] + pull_y
    return Twist2(c * vx + s * vy, -s * vx + c * vy, rate * ahead.yaw_rate + pull_yaw)


def bounded(twist: Twist2, max_speed_mps: float, max_yaw_rate_radps: float) -> Twist2:
    """``twist`` with its speed and its yaw rate inside their limits, each separately, so that the course is kept."""
    speed = twist.speed()
    factor = 1.0 if speed <= max_speed_mps else max_speed_mps / speed
    omega = max(-max_yaw_rate_radps, min(max_yaw_rate_radps, twist.omega))
    return Twist2(twist.vx * factor, twist.vy * factor, omega)


def settle_command(goal: Pose2, pose: Pose2, limits: MotionLimits, params: TrackingParams) -> Twist2:
    """Towards ``goal`` by feedback alone, for the last centimetres. limits: bounds of speed and yaw rate."""
    error = tracking_error(goal, pose)
    vx, vy = _bounded(error.x, error.y, params.position_gain_per_s, limits.speed_mps)
    omega = params.yaw_gain_per_s * error.yaw
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    return bounded(Twist2(c * vx + s * vy, -s * vx + c * vy, omega), limits.speed_mps, limits.yaw_rate_radps)


def _bounded(x: float, y: float, gain: float, limit: float) -> tuple[float, float]:
    size = gain * math.hypot(x, y)
    factor = gain if size <= limit else gain * limit / size
    return factor * x, factor * y
