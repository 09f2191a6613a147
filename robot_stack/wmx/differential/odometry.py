"""Odometry of two wheels from their accumulated angles.

The way between two readings is the arc that constant wheel speeds drive, exactly. The variance of each wheel's way
grows with its length and reaches the pose through the Jacobians of the arc's chord (Siegwart, Nourbakhsh: Introduction
to Autonomous Mobile Robots, 5.2.4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import IDENTITY, Pose2, Twist2, exp_se2
from robot_stack.wmx.differential.kinematics import BaseGeometry, WheelPair, body_twist
from robot_stack.wmx.differential.params import Matrix3, OdometryParams

ZERO_MATRIX: Matrix3 = (0.0,) * 9


@dataclass(frozen=True, slots=True)
class WheelReading:
    """stamp_s: time of the reading. angles: accumulated, rad. generation: differs after a reset of the angles."""

    stamp_s: float
    angles: WheelPair
    generation: int = 0


@dataclass(frozen=True, slots=True)
class Odometry:
    """pose: of the base in odom. covariance: of (x, y, yaw) in odom. fault: why the last reading was not integrated."""

    pose: Pose2 = IDENTITY
    covariance: Matrix3 = ZERO_MATRIX
    fault: str = ""


class WheelOdometry:
    """Accumulates readings."""

    def __init__(self, base: BaseGeometry, params: OdometryParams, max_wheel_speed_radps: float) -> None:
        """max_wheel_speed_radps: an encoder that reports more than twice this has jumped, or was reset by a homing."""
        self._base = base
        self._params, self._max_wheel_speed_radps = params, max_wheel_speed_radps
        self._last: WheelReading | None = None
        self._odometry = Odometry()

    def update(self, reading: WheelReading) -> Odometry:
        """The odometry after ``reading``. An implausible motion is ignored and named in ``fault``."""
        if not all(map(math.isfinite, (reading.stamp_s, reading.angles.left, reading.angles.right))):
            self._odometry = replace(self._odometry, fault="encoder reading is not finite")
            return self._odometry
        last, self._last = self._last, reading
        if last is None:
            return self._odometry
        fault = self._doubt(last, reading)
        self._odometry = replace(self._odometry, fault=fault) if fault else self._moved(_way(last, reading))
        return self._odometry

    def _doubt(self, last: WheelReading, reading: WheelReading) -> str:
        """The reason if the motion between two readings is unknown; empty if it is known."""
        params = self._params
        elapsed_s = reading.stamp_s - last.stamp_s
        if reading.generation != last.generation or elapsed_s < 0.0:
            return "the engine restarted: motion meanwhile is unknown"
        if elapsed_s > params.longest_gap_s:
            return f"no encoder reading for {elapsed_s:.2f} s, at most {params.longest_gap_s} s: motion is unknown"
        allowed = 2.0 * self._max_wheel_speed_radps * max(elapsed_s, params.shortest_interval_s)
        way = _way(last, reading)
        jumped = [
            f"{name} by {angle:.2f} rad"
            for name, angle in (("left", way.left), ("right", way.right))
            if abs(angle) > allowed
        ]
        return f"encoder jumped within {elapsed_s:.3f} s: {', '.join(jumped)}" if jumped else ""

    def _moved(self, way: WheelPair) -> Odometry:
        forward_m, turn_rad = body_twist(way, self._base)
        if forward_m == 0.0 and turn_rad == 0.0:
            return replace(self._odometry, fault="")
        pose = self._odometry.pose
        moved = pose.compose(exp_se2(Twist2(forward_m, 0.0, turn_rad), 1.0))
        return Odometry(moved, self._propagated(pose.yaw + 0.5 * turn_rad, forward_m, way))

    def _propagated(self, heading_rad: float, forward_m: float, way: WheelPair) -> Matrix3:
        """The covariance after a chord of ``forward_m`` in the direction ``heading_rad``."""
        c, s, track = math.cos(heading_rad), math.sin(heading_rad), self._base.track_m
        by_pose = np.array([[1.0, 0.0, -forward_m * s], [0.0, 1.0, forward_m * c], [0.0, 0.0, 1.0]])
        sway = forward_m / (2.0 * track)
        by_wheels = np.array(
            [
                [0.5 * c + sway * s, 0.5 * c - sway * s],
                [0.5 * s - sway * c, 0.5 * s + sway * c],
                [-1.0 / track, 1.0 / track],
            ]
        )
        per_rad = self._params.deviation_per_sqrt_m**2 * self._base.radius_m
        of_wheels = np.diag([per_rad * abs(way.left), per_rad * abs(way.right)])
        before: NDArray[np.float64] = np.array(self._odometry.covariance).reshape(3, 3)
        after = by_pose @ before @ by_pose.T + by_wheels @ of_wheels @ by_wheels.T
        return tuple(after.ravel().tolist())


def _way(last: WheelReading, reading: WheelReading) -> WheelPair:
    return WheelPair(reading.angles.left - last.angles.left, reading.angles.right - last.angles.right)
