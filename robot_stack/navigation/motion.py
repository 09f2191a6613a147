"""Planned motion of the body in the map, as a function of time."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_stack.core.geometry import Pose2, Twist2, wrap_angle
from robot_stack.navigation.speed_profile import Profile

Vector = tuple[float, float]


@dataclass(frozen=True, slots=True)
class MotionState:
    """Pose and its derivatives at one moment, all in the map frame: m, m/s, m/s2 and rad, rad/s, rad/s2."""

    pose: Pose2
    velocity: Vector = (0.0, 0.0)
    yaw_rate: float = 0.0
    acceleration: Vector = (0.0, 0.0)
    yaw_acceleration: float = 0.0

    def is_finite(self) -> bool:
        numbers = (*self.velocity, self.yaw_rate, *self.acceleration, self.yaw_acceleration)
        return self.pose.is_finite() and all(map(math.isfinite, numbers))

    def speed(self) -> float:
        return math.hypot(*self.velocity)


def moving(pose: Pose2, twist: Twist2) -> MotionState:
    """The state of a body at ``pose`` in map with ``twist`` in its own frame; unknown accelerations are zero."""
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    return MotionState(pose, (c * twist.vx - s * twist.vy, s * twist.vx + c * twist.vy), twist.omega)


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of translation: start + velocity * t + direction * profile(t)."""

    start: Vector
    velocity: Vector
    direction: Vector
    profile: Profile

    @property
    def duration_s(self) -> float:
        return self.profile.duration_s

    def at(self, time_s: float) -> tuple[Vector, Vector, Vector]:
        """(position, velocity, acceleration) at a time inside the segment."""
        x, v, a = self.profile.at(time_s)
        (px, py), (vx, vy), (dx, dy) = self.start, self.velocity, self.direction
        return (
            (px + vx * time_s + dx * x, py + vy * time_s + dy * x),
            (vx + dx * v, vy + dy * v),
            (dx * a, dy * a),
        )

    def end(self) -> tuple[Vector, Vector, Vector]:
        return self.at(self.duration_s)


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Successive translation segments and the simultaneous yaw profile. After the end its pose is constant."""

    segments: tuple[Segment, ...]
    start_yaw: float
    yaw: Profile

    @property
    def duration_s(self) -> float:
        return max(self.yaw.duration_s, sum(segment.duration_s for segment in self.segments))

    def at(self, time_s: float) -> MotionState:
        """The state at a time since the start; clamped to start and end."""
        turn, yaw_rate, yaw_acceleration = self.yaw.at(time_s)
        position, velocity, acceleration = self._translation(max(time_s, 0.0))
        pose = Pose2(*position, wrap_angle(self.start_yaw + turn))
        return MotionState(pose, velocity, yaw_rate, acceleration, yaw_acceleration)

    def end(self) -> MotionState:
        return self.at(self.duration_s)

    def _translation(self, time_s: float) -> tuple[Vector, Vector, Vector]:
        for segment in self.segments[:-1]:
            if time_s < segment.duration_s:
                return segment.at(time_s)
            time_s -= segment.duration_s
        last = self.segments[-1]
        return last.at(min(time_s, last.duration_s))
