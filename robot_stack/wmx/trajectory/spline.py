"""The engine's spline: cubic, through every point at its time, at rest at both ends.

A clamped interpolating cubic spline, continuous to the second derivative (de Boor, A Practical Guide to Splines,
ch. IV). Its knot velocities solve a tridiagonal system; between knots it is the Hermite cubic of positions and
velocities at its ends.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class ClampedSpline:
    """times_s: (n,) strictly increasing, n >= 2. positions: (n, joints) rad. Before and after it, it stands."""

    def __init__(self, times_s: FloatArray, positions: FloatArray) -> None:
        self.times_s, self.positions = times_s, positions
        self.velocities = _knot_velocities(times_s, positions)

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
        k = int(np.searchsorted(self.times_s, time_s, side="right")) - 1
        u = time_s - self.times_s[k]
        a2, a3 = self._coefficients(slice(k, k + 1))
        p, v = self.positions[k], self.velocities[k]
        return (
            p + u * (v + u * (a2[0] + u * a3[0])),
            v + u * (2.0 * a2[0] + 3.0 * u * a3[0]),
            2.0 * a2[0] + 6.0 * u * a3[0],
        )

    def max_speed(self) -> FloatArray:
        """The greatest |velocity| of each joint, (joints,) rad/s: at knots, or where a segment's acceleration is 0."""
        a2, a3 = self._coefficients(slice(None, -1))
        h = np.diff(self.times_s)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.where(a3 != 0.0, -a2 / (3.0 * a3), 0.0)
        inside = np.where((u > 0.0) & (u < h), u, 0.0)
        between = self.velocities[:-1] + inside * (2.0 * a2 + 3.0 * inside * a3)
        fastest: FloatArray = np.maximum(np.abs(between).max(axis=0), np.abs(self.velocities).max(axis=0))
        return fastest

    def max_acceleration(self) -> FloatArray:
        """The greatest |acceleration| of each joint, (joints,) rad/s^2: it is linear between knots."""
        a2, a3 = self._coefficients(slice(None, -1))
        h = np.diff(self.times_s)[:, None]
        greatest: FloatArray = np.maximum(np.abs(2.0 * a2), np.abs(2.0 * a2 + 6.0 * h * a3)).max(axis=0)
        return greatest

    def _coefficients(self, segments: slice) -> tuple[FloatArray, FloatArray]:
        """Second and third coefficient of p + v u + a2 u^2 + a3 u^3 of the segments, each (segments, joints)."""
        first = np.arange(len(self.times_s))[segments]
        h = (self.times_s[first + 1] - self.times_s[first])[:, None]
        slope = (self.positions[first + 1] - self.positions[first]) / h
        v0, v1 = self.velocities[first], self.velocities[first + 1]
        return (3.0 * slope - 2.0 * v0 - v1) / h, (v0 + v1 - 2.0 * slope) / h**2


def _knot_velocities(times_s: FloatArray, positions: FloatArray) -> FloatArray:
    """Thomas' algorithm on h[i] v[i-1] + 2 (h[i-1] + h[i]) v[i] + h[i-1] v[i+1] = right[i], v zero at both ends."""
    n = len(times_s)
    velocities = np.zeros_like(positions)
    if n < 3:
        return velocities
    h = np.diff(times_s)
    slope = np.diff(positions, axis=0) / h[:, None]
    right = 3.0 * (h[1:, None] * slope[:-1] + h[:-1, None] * slope[1:])
    steps = h.tolist()
    upper = [0.0] * (n - 2)
    for i in range(n - 2):
        before, after = steps[i], steps[i + 1]
        pivot = 2.0 * (before + after) - (after * upper[i - 1] if i else 0.0)
        upper[i] = before / pivot
        right[i] = (right[i] - after * right[i - 1] if i else right[i]) / pivot
    velocities[n - 2] = right[n - 3]
    for i in range(n - 4, -1, -1):
        velocities[i + 1] = right[i] - upper[i] * velocities[i + 2]
    return velocities
