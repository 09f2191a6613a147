"""The points of a trajectory, in the order of the axes, and their curve.

As in ros2_controllers' joint_trajectory_controller, positions and velocities make a cubic between two points, and with
accelerations a quintic. Positions alone make one cubic spline, at rest at both ends, as the interface document of this
server requires.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PPoly

FloatArray = NDArray[np.float64]
STANDS_RADPS = float(np.finfo(np.float32).eps)
"""Velocity below which joint_trajectory_controller assumes zero."""

_LOOKS = 17
"""Places in a segment at which the greatest acceleration is searched for."""


@dataclass(frozen=True, slots=True)
class Waypoints:
    """times_s: (n,) strictly increasing. positions: (n, joints) rad. velocities (rad/s) and accelerations (rad/s^2)
    likewise, of all points or None; accelerations only with velocities.
    """

    times_s: FloatArray
    positions: FloatArray
    velocities: FloatArray | None = None
    accelerations: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.times_s)

    def rows(self, chosen: slice) -> Waypoints:
        return Waypoints(
            self.times_s[chosen],
            self.positions[chosen],
            None if self.velocities is None else self.velocities[chosen],
            None if self.accelerations is None else self.accelerations[chosen],
        )

    def after_rest(self, position: FloatArray) -> Waypoints:
        """Prepends a point at time 0 and at rest."""
        still = np.zeros((1, self.positions.shape[1]))
        return Waypoints(
            np.concatenate([[0.0], self.times_s]),
            np.vstack([position, self.positions]),
            None if self.velocities is None else np.vstack([still, self.velocities]),
            None if self.accelerations is None else np.vstack([still, self.accelerations]),
        )

    def slowed(self, factor: float) -> Waypoints:
        """The same path in ``1 / factor`` of the time."""
        return Waypoints(
            self.times_s / factor,
            self.positions,
            None if self.velocities is None else self.velocities * factor,
            None if self.accelerations is None else self.accelerations * factor**2,
        )

    def unwrapped(self, present: FloatArray, continuous: tuple[int, ...]) -> Waypoints:
        """Moves continuous joints by whole turns, so that the first point is the shortest way off; half a turn is gone
        in the direction of the goal's values.
        """
        if not continuous or not len(self):
            return self
        shift = np.zeros(self.positions.shape[1])
        for axis in continuous:
            turns = (present[axis] - self.positions[0, axis]) / (2.0 * np.pi)
            whole = round(turns)
            if abs(abs(turns - whole) - 0.5) < 1e-9:
                whole = int(np.ceil(turns) if turns < 0.0 else np.floor(turns))
            shift[axis] = 2.0 * np.pi * whole
        return replace(self, positions=self.positions + shift)


def knot_velocities(points: Waypoints) -> FloatArray:
    """The velocities with which the curve passes its points, (n, joints) rad/s."""
    if points.velocities is not None:
        return points.velocities
    velocities: FloatArray = CubicSpline(points.times_s, points.positions, bc_type="clamped")(points.times_s, 1)
    return velocities


def curve_of(points: Waypoints) -> PPoly:
    """The curve through at least two points: positions (rad) of all joints over time (s)."""
    v, a = knot_velocities(points), points.accelerations
    p = points.positions
    ends = (p[:-1], p[1:], v[:-1], v[1:])
    coefficients = segments(np.diff(points.times_s), *ends, *((None, None) if a is None else (a[:-1], a[1:])))
    return PPoly(coefficients, points.times_s)


def segments(
    h: FloatArray,
    p0: FloatArray,
    p1: FloatArray,
    v0: FloatArray,
    v1: FloatArray,
    a0: FloatArray | None = None,
    a1: FloatArray | None = None,
) -> FloatArray:
    """Coefficients (6, segments, joints) of u^5 ... u^0: cubics, or quintics where accelerations are given."""
    h = h[:, None]
    c = np.zeros((6, len(h), p1.shape[1]))
    c[5], c[4] = p0, v0
    if a0 is None or a1 is None:
        c[3] = (3.0 * (p1 - p0) / h - 2.0 * v0 - v1) / h
        c[2] = (2.0 * (p0 - p1) / h + v0 + v1) / h**2
        return c
    # The remainder at the end, after the start's velocity and acceleration are extrapolated.
    dp, dv, da = p1 - p0 - h * (v0 + 0.5 * h * a0), v1 - v0 - h * a0, a1 - a0
    c[3] = 0.5 * a0
    c[2] = (10.0 * dp / h - 4.0 * dv + 0.5 * h * da) / h**2
    c[1] = (-15.0 * dp / h + 7.0 * dv - h * da) / h**3
    c[0] = (6.0 * dp / h - 3.0 * dv + 0.5 * h * da) / h**4
    return c


def peak_accelerations(h: FloatArray, c: FloatArray) -> FloatArray:
    """The greatest |acceleration| of each segment and joint, (segments, joints) rad/s^2: that of cubics is exact."""
    u = np.linspace(0.0, 1.0, _LOOKS)[:, None, None] * h[None, :, None]
    peaks: FloatArray = np.abs(2.0 * c[3] + u * (6.0 * c[2] + u * (12.0 * c[1] + u * 20.0 * c[0]))).max(axis=0)
    return peaks
