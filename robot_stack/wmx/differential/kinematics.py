"""Kinematics of a base with two driven wheels on one axle.

Wheel speeds are rad/s, positive where the wheel drives the base forward. A twist is the forward speed (m/s) and the
turning rate (rad/s, counter-clockwise positive) of the point between the wheels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class BaseGeometry:
    """radius_m: of both wheels. track_m: between the points where they touch the ground."""

    radius_m: float
    track_m: float


@dataclass(frozen=True, slots=True)
class WheelPair:
    """One quantity of both wheels."""

    left: float
    right: float

    @property
    def largest(self) -> float:
        """The larger of the two magnitudes."""
        return max(abs(self.left), abs(self.right))


@dataclass(frozen=True, slots=True)
class WheelAxes:
    """The engine's axes of the wheels. polarity: -1 for an axis that turns backwards when its wheel drives forward."""

    left: int
    right: int
    left_polarity: int
    right_polarity: int

    def wheels(self, of_axes: Sequence[float] | NDArray[np.float64]) -> WheelPair:
        """(n_axes,) a quantity by axis, as the wheels have it."""
        return self.turned(WheelPair(float(of_axes[self.left]), float(of_axes[self.right])))

    def turned(self, pair: WheelPair) -> WheelPair:
        """Converts between wheel direction and axis direction, either way."""
        return WheelPair(pair.left * self.left_polarity, pair.right * self.right_polarity)


REST = WheelPair(0.0, 0.0)


def wheel_speeds(linear_mps: float, angular_radps: float, base: BaseGeometry, limit_radps: float) -> WheelPair:
    """The speeds of the wheels for a finite twist.

    Beyond ``limit_radps`` both are scaled alike, so that the base drives the same curve, slower.
    """
    speeds = _speeds(linear_mps, angular_radps, base)
    if speeds.largest <= limit_radps:
        return speeds
    # Scaled before it is computed: an absurd twist must not overflow on its way to the limit.
    size = max(abs(linear_mps), abs(angular_radps), 1.0)
    unit = _speeds(linear_mps / size, angular_radps / size, base)
    factor = limit_radps / unit.largest
    return WheelPair(unit.left * factor, unit.right * factor)


def _speeds(linear_mps: float, angular_radps: float, base: BaseGeometry) -> WheelPair:
    return WheelPair(
        (2.0 * linear_mps - angular_radps * base.track_m) / (2.0 * base.radius_m),
        (2.0 * linear_mps + angular_radps * base.track_m) / (2.0 * base.radius_m),
    )


def body_twist(speeds: WheelPair, base: BaseGeometry) -> tuple[float, float]:
    """(forward speed in m/s, turning rate in rad/s) of wheels that roll; or, of angles, the way and the turn."""
    left_m, right_m = speeds.left * base.radius_m, speeds.right * base.radius_m
    return 0.5 * (right_m + left_m), (right_m - left_m) / base.track_m
