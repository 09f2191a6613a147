"""Converts poses of ``/odom`` to increments: the motion since the last message and its variance.

Odometry is a pose that integrates by itself, so lost messages do no harm: the difference of two poses is the motion
between them, however long it took. A restart of the odometry frame must not be taken for motion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from robot_stack.core.geometry import IDENTITY, Pose2, Twist2
from robot_stack.core.pose_history import StepLimit
from robot_stack.localization.params import OdometryParams

Variances = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class OdometryReading:
    """One message of wheel odometry.

    pose: base_link in odom. twist: in base_link.
    pose_variance: (x, y, yaw) of the pose, m2, m2, rad2. twist_variance: (vx, vy, omega), (m/s)2, (m/s)2, (rad/s)2.
    A negative variance means unknown, as in ROS messages.
    """

    stamp_s: float
    pose: Pose2
    twist: Twist2
    pose_variance: Variances
    twist_variance: Variances

    def problem(self) -> str:
        """Why this reading cannot be used; empty if it can."""
        if not math.isfinite(self.stamp_s):
            return f"/odom stamp is {self.stamp_s}"
        for name, value in (("pose", self.pose), ("twist", self.twist)):
            if not value.is_finite():
                return f"/odom {name} is not finite: {value}"
        for name, variances in (("pose", self.pose_variance), ("twist", self.twist_variance)):
            if not all(map(math.isfinite, variances)):
                return f"/odom {name} covariance is not finite: {variances}"
        return ""


class OdometryEvent(Enum):
    """Classification of a reading."""

    FIRST = "first reading"
    MOTION = "motion"
    RESTARTED = "odometry restarted: pose held, uncertainty raised"
    CLOCK_RESTARTED = "clock moved backwards: odometry restarted"
    LATE = "reading older than the last one: ignored"
    UNUSABLE = "reading not finite: ignored"


@dataclass(frozen=True, slots=True)
class Increment:
    """Motion of base_link between two readings, in the frame of base_link at the first.

    variance: (x, y, yaw), m2, m2, rad2.
    """

    event: OdometryEvent
    stamp_s: float
    dt_s: float
    motion: Pose2
    variance: Variances


class OdometryIncrements:
    """Turns readings into increments.

    max_speed_mps, max_yaw_rate_radps: limits of the robot; a faster increment is a restart of the odometry frame.
    """

    def __init__(self, params: OdometryParams, max_speed_mps: float, max_yaw_rate_radps: float) -> None:
        self._params = params
        fastest = max_speed_mps * params.max_speed_factor, max_yaw_rate_radps * params.max_speed_factor
        self._steps = StepLimit(*fastest, params.jump_tolerance_m, params.jump_tolerance_rad)
        self._last: OdometryReading | None = None

    def take(self, reading: OdometryReading) -> Increment:
        """The increment up to ``reading``. Readings that are late or not finite change nothing."""
        if reading.problem():
            return Increment(OdometryEvent.UNUSABLE, math.nan, 0.0, IDENTITY, (0.0, 0.0, 0.0))
        last = self._last
        if last is None:
            self._last = reading
            return Increment(OdometryEvent.FIRST, reading.stamp_s, 0.0, IDENTITY, (0.0, 0.0, 0.0))
        dt_s = reading.stamp_s - last.stamp_s
        if -self._params.clock_restart_s < dt_s <= 0.0:
            return Increment(OdometryEvent.LATE, last.stamp_s, 0.0, IDENTITY, (0.0, 0.0, 0.0))
        self._last = reading
        if dt_s <= 0.0:
            return self._held(OdometryEvent.CLOCK_RESTARTED, last, reading, self._params.max_gap_s)
        motion = reading.pose.relative_to(last.pose)
        if self._is_restart(last, reading, motion, dt_s):
            return self._held(OdometryEvent.RESTARTED, last, reading, min(dt_s, self._params.max_gap_s))
        variance = self._variance(last, reading, motion, dt_s)
        return Increment(OdometryEvent.MOTION, reading.stamp_s, dt_s, motion, variance)

    def _is_restart(self, last: OdometryReading, reading: OdometryReading, motion: Pose2, dt_s: float) -> bool:
        # The covariance of dead reckoning never shrinks: if it does, odometry has restarted.
        return not self._steps.allows(motion, dt_s) or sum(reading.pose_variance) < 0.5 * sum(last.pose_variance)

    def _held(
        self, event: OdometryEvent, last: OdometryReading, reading: OdometryReading, unseen_s: float
    ) -> Increment:
        """Unknown motion: the robot may have continued at its last twist for ``unseen_s``."""
        distance_m, turn_rad = last.twist.speed() * unseen_s, last.twist.omega * unseen_s
        position_m2 = (distance_m + self._params.jump_tolerance_m) ** 2
        yaw_rad2 = (abs(turn_rad) + self._params.jump_tolerance_rad) ** 2
        return Increment(event, reading.stamp_s, 0.0, IDENTITY, (position_m2, position_m2, yaw_rad2))

    def _variance(self, last: OdometryReading, reading: OdometryReading, motion: Pose2, dt_s: float) -> Variances:
        """Growth with the distance travelled, plus the twist's variance from the message over the interval."""
        distance_m, turn_rad = math.hypot(motion.x, motion.y), abs(motion.yaw)
        p = self._params
        position_m2 = p.position_growth_m_per_sqrt_m**2 * distance_m
        yaw_rad2 = p.yaw_growth_rad_per_sqrt_m**2 * distance_m + p.yaw_growth_rad_per_sqrt_rad**2 * turn_rad
        known_s2 = min(dt_s, p.max_gap_s) ** 2
        vx, vy, omega = (max(0.0, a, b) for a, b in zip(last.twist_variance, reading.twist_variance, strict=True))
        x, y, yaw = self._lost_track(last, reading)
        return position_m2 + vx * known_s2 + x, position_m2 + vy * known_s2 + y, yaw_rad2 + omega * known_s2 + yaw

    def _lost_track(self, last: OdometryReading, reading: OdometryReading) -> Variances:
        """Growth of the pose's covariance beyond that of the motion: the odometry itself lost track meanwhile.

        Detected by the yaw, whose variance only adds up; the position's also grows with the yaw error and is not used.
        """
        x, y, yaw = (max(0.0, b - a) for a, b in zip(last.pose_variance, reading.pose_variance, strict=True))
        return (x, y, yaw) if yaw > self._params.jump_tolerance_rad**2 else (0.0, 0.0, 0.0)
