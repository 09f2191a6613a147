"""The engine's spline: cubic, through every point at its time, at rest at both ends, C2 in between."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

FloatArray = NDArray[np.float64]


class ClampedSpline:
    """times_s: (n,) strictly increasing, n >= 2. positions: (n, joints) rad. At rest before and after it."""

    def __init__(self, times_s: FloatArray, positions: FloatArray) -> None:
        self.times_s, self.positions = times_s, positions
        self._curve = CubicSpline(times_s, positions, bc_type="clamped")

    @property
    def duration_s(self) -> float:
        return float(self.times_s[-1] - self.times_s[0])

    def evaluate(self, time_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position (rad), velocity (rad/s) and acceleration (rad/s^2) of every joint, each (joints,)."""
        still = np.zeros(self.positions.shape[1])
        if time_s <= self.times_s[0]:
            return self.positions[0].copy(), still, still.copy()
        if time_s >= self.times_s[-1]:
            return self.positions[-1].copy(), still, still.copy()
        return self._curve(time_s), self._curve(time_s, 1), self._curve(time_s, 2)

    def positions_at(self, times_s: FloatArray) -> FloatArray:
        """(len(times_s), joints) rad, at times between the first and the last."""
        positions: FloatArray = self._curve(times_s)
        return positions

    def velocities_at(self, times_s: FloatArray) -> FloatArray:
        """(len(times_s), joints) rad/s, likewise."""
        velocities: FloatArray = self._curve(times_s, 1)
        return velocities

    def max_speed(self) -> FloatArray:
        """The greatest |velocity| of each joint, (joints,) rad/s: at knots, or where a segment's acceleration is 0."""
        a3, a2, v, _ = self._curve.c
        h = np.diff(self.times_s)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.where(a3 != 0.0, -a2 / (3.0 * a3), 0.0)
        inside = np.where((u > 0.0) & (u < h), u, 0.0)
        between = v + inside * (2.0 * a2 + 3.0 * inside * a3)
        fastest: FloatArray = np.maximum(np.abs(between).max(axis=0), np.abs(v).max(axis=0))
        return fastest

    def longest_stop_s(self) -> float:
        """Longest time of a stop along the path: the engine stops a spline at about its greatest acceleration, of all
        joints together (WMX3 API reference, StartCSplinePos). Twice that, because the path bends.
        """
        a3, a2, _, _ = self._curve.c
        h = np.diff(self.times_s)[:, None]
        greatest = max(float(np.linalg.norm(2.0 * a, axis=1).max()) for a in (a2, a2 + 3.0 * h * a3))
        return 2.0 * float(self.max_speed().max()) / greatest if greatest > 0.0 else 0.0

    def max_acceleration(self) -> FloatArray:
        """The greatest |acceleration| of each joint, (joints,) rad/s^2: it is linear between knots."""
        a3, a2, _, _ = self._curve.c
        h = np.diff(self.times_s)[:, None]
        greatest: FloatArray = np.maximum(np.abs(2.0 * a2), np.abs(2.0 * a2 + 6.0 * h * a3)).max(axis=0)
        return greatest
