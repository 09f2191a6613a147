"""Planar rigid-body geometry: poses and twists in SE(2).

Angles in rad, lengths in m, right-handed frames with z up (REP 103). Pure functions, plain floats.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

_PLANAR: Final = (0, 1, 5)  # x, y, yaw of x, y, z, roll, pitch, yaw
_UNMEASURED: Final = (2, 3, 4)
_HUGE_VARIANCE: Final = 1e6


def wrap_angle(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


@dataclass(frozen=True, slots=True)
class Twist2:
    """Velocity of a planar body in its own frame: vx, vy in m/s, omega in rad/s."""

    vx: float
    vy: float
    omega: float

    def is_finite(self) -> bool:
        return math.isfinite(self.vx) and math.isfinite(self.vy) and math.isfinite(self.omega)

    def speed(self) -> float:
        """Translational speed in m/s."""
        return math.hypot(self.vx, self.vy)

    def scaled(self, factor: float) -> Twist2:
        return Twist2(self.vx * factor, self.vy * factor, self.omega * factor)


ZERO_TWIST = Twist2(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Pose2:
    """Pose of a planar body: x, y in m, yaw in rad, in the frame the caller names."""

    x: float
    y: float
    yaw: float

    def is_finite(self) -> bool:
        return math.isfinite(self.x) and math.isfinite(self.y) and math.isfinite(self.yaw)

    def compose(self, other: Pose2) -> Pose2:
        """self * other: ``other`` given in this pose's frame, expressed in the parent frame."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return Pose2(
            self.x + c * other.x - s * other.y, self.y + s * other.x + c * other.y, wrap_angle(self.yaw + other.yaw)
        )

    def inverse(self) -> Pose2:
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return Pose2(-c * self.x - s * self.y, s * self.x - c * self.y, wrap_angle(-self.yaw))

    def relative_to(self, origin: Pose2) -> Pose2:
        """This pose expressed in the frame of ``origin``: origin^-1 * self."""
        return origin.inverse().compose(self)

    def distance_to(self, other: Pose2) -> float:
        return math.hypot(other.x - self.x, other.y - self.y)


IDENTITY = Pose2(0.0, 0.0, 0.0)


def exp_se2(twist: Twist2, dt_s: float) -> Pose2:
    """The motion of a body that keeps ``twist`` for ``dt_s``: the exponential map of SE(2).

    Exact for a constant twist; the series near omega = 0 keeps full precision there.
    """
    dx, dy, dyaw = twist.vx * dt_s, twist.vy * dt_s, twist.omega * dt_s
    if abs(dyaw) < 1e-6:
        sin_term, cos_term = 1.0 - dyaw * dyaw / 6.0, 0.5 * dyaw
    else:
        sin_term, cos_term = math.sin(dyaw) / dyaw, (1.0 - math.cos(dyaw)) / dyaw
    return Pose2(sin_term * dx - cos_term * dy, cos_term * dx + sin_term * dy, wrap_angle(dyaw))


def yaw_from_quaternion(x: float, y: float, z: float, w: float) -> float:
    """Yaw of a unit quaternion (rotation about z first in the z-y-x convention), rad."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def tilt_from_quaternion(x: float, y: float, z: float, w: float) -> tuple[float, float]:
    """(roll, pitch) of a unit quaternion in the convention of ``yaw_from_quaternion``, rad; pitch in [-pi/2, pi/2]."""
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return roll, math.asin(min(1.0, max(-1.0, 2.0 * (w * y - z * x))))


class Vector(Protocol):
    """As of geometry_msgs: x, y in m."""

    x: float
    y: float


class Quaternion(Vector, Protocol):
    """As of geometry_msgs."""

    z: float
    w: float


def planar_pose(position: Vector, orientation: Quaternion) -> Pose2:
    """Projection of a pose in space onto the ground plane."""
    q = orientation
    return Pose2(position.x, position.y, yaw_from_quaternion(q.x, q.y, q.z, q.w))


def quaternion_from_yaw(yaw_rad: float) -> tuple[float, float, float, float]:
    """Unit quaternion (x, y, z, w) of a pure yaw."""
    return 0.0, 0.0, math.sin(0.5 * yaw_rad), math.cos(0.5 * yaw_rad)


def covariance_of_message(planar: Sequence[float]) -> list[float]:
    """Row-major 6 x 6 of a 3 x 3 covariance of (x, y, yaw). Unmeasured components have a huge variance."""
    full = [0.0] * 36
    for row, i in enumerate(_PLANAR):
        for column, j in enumerate(_PLANAR):
            full[6 * i + j] = planar[3 * row + column]
    for i in _UNMEASURED:
        full[7 * i] = _HUGE_VARIANCE
    return full
