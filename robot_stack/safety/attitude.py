"""Inclination: the direction of gravity from gyroscope and accelerometer.

A complementary filter on the direction of "up" in base_link: the gyroscope turns it (fast, drifts), the accelerometer
pulls it back (slow, disturbed by every acceleration of the robot). After R. Mahony, T. Hamel, J.-M. Pflimlin,
"Nonlinear Complementary Filters on the Special Orthogonal Group", IEEE TAC 2008, without its bias estimate: a gyroscope
bias b leaves an error of b times the time constant. The acceleration measured by the wheels is subtracted from the
accelerometer's first, so that neither a start nor a long curve looks like a slope.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_stack.safety.inputs import ImuSample


@dataclass(frozen=True, slots=True)
class Vector3:
    x: float
    y: float
    z: float

    def norm(self) -> float:
        return math.sqrt(self.x * self.x + self.y * self.y + self.z * self.z)

    def plus(self, other: Vector3, factor: float) -> Vector3:
        """self + factor * other."""
        return Vector3(self.x + factor * other.x, self.y + factor * other.y, self.z + factor * other.z)

    def cross(self, other: Vector3) -> Vector3:
        return Vector3(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )

    def unit(self) -> Vector3:
        """The same direction with length 1. Raises ZeroDivisionError for the zero vector."""
        norm = self.norm()
        return Vector3(self.x / norm, self.y / norm, self.z / norm)


ZERO = Vector3(0.0, 0.0, 0.0)


class PlanarAcceleration:
    """Acceleration of base_link, m/s2, from its planar velocity: dv/dt + omega x v, low-passed and bounded.

    The bound, the robot's largest acceleration, prevents spinning wheels from hiding a slope.
    """

    def __init__(self, filter_s: float, max_mps2: float) -> None:
        self._filter_s = filter_s
        self._max_mps2 = max_mps2
        self._velocity = self._slow = ZERO
        self._at_s = math.inf

    def update(self, vx_mps: float, vy_mps: float, now_s: float) -> None:
        """A new velocity in base_link. A gap longer than the filter's time constant restarts the derivative."""
        velocity = Vector3(vx_mps, vy_mps, 0.0)
        if self._fresh(now_s):
            dt_s = now_s - self._at_s
            self._slow = self._slow.plus(velocity.plus(self._slow, -1.0), dt_s / (self._filter_s + dt_s))
        else:
            self._slow = velocity
        self._velocity, self._at_s = velocity, now_s

    def at(self, yaw_rate_radps: float, now_s: float) -> Vector3:
        """Acceleration now, zero if the velocity is older than the filter's time constant."""
        if not self._fresh(now_s):
            return ZERO
        # Backward Euler: in a steady ramp the low pass lags by exactly filter_s times the slope.
        speeding_up = self._velocity.plus(self._slow, -1.0)
        turning = Vector3(0.0, 0.0, yaw_rate_radps).cross(self._velocity)
        acceleration = turning.plus(speeding_up, 1.0 / self._filter_s)
        return ZERO.plus(acceleration, self._max_mps2 / max(self._max_mps2, acceleration.norm()))

    def _fresh(self, now_s: float) -> bool:
        return 0.0 <= now_s - self._at_s <= self._filter_s


class UpDirection:
    """Direction of "up" in base_link. Unknown until ``settle_s`` of samples have been averaged."""

    def __init__(self, time_constant_s: float, settle_s: float, max_gap_s: float) -> None:
        self._time_constant_s = time_constant_s
        self._settle_s = settle_s
        self._max_gap_s = max_gap_s
        self._last_s = math.inf
        self._restart(math.inf)

    def update(self, sample: ImuSample, own_acceleration: Vector3, now_s: float) -> None:
        """A new sample, m/s2 and rad/s in base_link; ``own_acceleration`` m/s2 is the robot's, without gravity."""
        dt_s, self._last_s = now_s - self._last_s, now_s
        if not 0.0 <= dt_s <= self._max_gap_s:
            self._restart(now_s)
        force = Vector3(sample.ax, sample.ay, sample.az).plus(own_acceleration, -1.0)
        if self._up is None:
            self._settle(force, now_s)
        else:
            self._follow(force, Vector3(sample.wx, sample.wy, sample.wz), dt_s)

    def inclination_rad(self) -> float:
        """Angle between base_link's z axis and the vertical, [0, pi]; NaN while unknown."""
        if self._up is None:
            return math.nan
        return math.atan2(math.hypot(self._up.x, self._up.y), self._up.z)

    def downhill_rad(self) -> float:
        """Bearing of the fall line in base_link, down: 0 ahead, +pi/2 to the left; NaN while unknown."""
        return math.nan if self._up is None else math.atan2(-self._up.y, -self._up.x)

    def _restart(self, now_s: float) -> None:
        self._up: Vector3 | None = None
        self._sum, self._started_s = ZERO, now_s

    def _settle(self, force: Vector3, now_s: float) -> None:
        self._sum = self._sum.plus(force, 1.0)
        if now_s - self._started_s >= self._settle_s and self._sum.norm() > 0.0:
            self._up = self._sum.unit()

    def _follow(self, force: Vector3, rate: Vector3, dt_s: float) -> None:
        assert self._up is not None
        # A direction that is fixed in the world turns backwards in a turning body. Without the second order the
        # estimate on a slope would be too steep while the robot turns.
        spin = rate.cross(self._up)
        turned = self._up.plus(spin, -dt_s).plus(rate.cross(spin), 0.5 * dt_s * dt_s)
        pull = dt_s / (self._time_constant_s + dt_s)
        norm = force.norm()
        if norm > 0.0:
            turned = turned.plus(force.plus(turned, -norm), pull / norm)
        self._up = turned.unit()
