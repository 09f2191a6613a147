"""Least squares of a rigid pose against fitted lines: Levenberg-Marquardt with Huber's weights, compiled.

A line fitted to evenly spread edge samples is known best, and independently, at its two Gauss points: +-1 / sqrt(3) of
half its length from the middle, each with the variance 2 s^2 / n. The model's points there must lie on the line; so
nothing of the samples is lost, and a side is used even where its neighbour cannot be seen.

A pose is (R, t): x_camera = R x_object + t. Small changes (w, d) act as exp(w) R x + t + d.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ITERATIONS = 30
_HUBER = 2.5  # standard deviations


def _compiled(function: Any) -> Any:
    return numba.njit(cache=True, fastmath=False)(function)


@_compiled
def _rotation(w: Array) -> Array:
    """exp of a rotation vector (Rodrigues)."""
    angle = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    k = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    if angle < 1e-9:
        return np.eye(3) + k
    return np.eye(3) + math.sin(angle) / angle * k + (1.0 - math.cos(angle)) / (angle * angle) * (k @ k)


@_compiled
def residuals(points: Array, lines: Array, weights: Array, rotation: Array, translation: Array) -> Array:
    """(n,) distances of projected points from their lines in standard deviations; NaN behind the camera."""
    out = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        p = rotation @ points[i] + translation
        if p[2] > 1e-6:
            out[i] = weights[i] * ((lines[i, 0] * p[0] + lines[i, 1] * p[1]) / p[2] - lines[i, 2])
        else:
            out[i] = np.nan
    return out


@_compiled
def _huber(r: Array) -> float:
    """Huber's cost; infinite with a NaN."""
    cost = 0.0
    for value in r:
        size = abs(value)
        if not size < np.inf:
            return np.inf
        cost += size * size if size <= _HUBER else _HUBER * (2.0 * size - _HUBER)
    return cost


@_compiled
def _normal_equations(
    points: Array, lines: Array, weights: Array, rotation: Array, translation: Array
) -> tuple[Array, Array]:
    """Gauss-Newton's H (6, 6) and gradient (6,), with Huber's weights."""
    h, g = np.zeros((6, 6)), np.zeros(6)
    row = np.empty(6)
    for i in range(points.shape[0]):
        q = rotation @ points[i]
        p = q + translation
        along = (lines[i, 0] * p[0] + lines[i, 1] * p[1]) / p[2]
        r = weights[i] * (along - lines[i, 2])
        scale = weights[i] / p[2]
        dx, dy, dz = scale * lines[i, 0], scale * lines[i, 1], -scale * along
        row[0], row[1], row[2] = q[1] * dz - q[2] * dy, q[2] * dx - q[0] * dz, q[0] * dy - q[1] * dx
        row[3], row[4], row[5] = dx, dy, dz
        robust = 1.0 if abs(r) <= _HUBER else _HUBER / abs(r)
        for j in range(6):
            g[j] += robust * row[j] * r
            for k in range(6):
                h[j, k] += robust * row[j] * row[k]
    return h, g


@_compiled
def solve(
    points: Array, lines: Array, weights: Array, rotation: Array, translation: Array
) -> tuple[Array, Array, float, Array]:
    """Refines a pose.

    points: (n, 3) in the object's frame, m. lines: (n, 3) unit normal and distance in normalised coordinates. weights:
    (n,) 1 / standard deviation. Returns (R (3, 3), t (3,), Huber cost, H (6, 6)); the cost is infinite without success.
    """
    cost = _huber(residuals(points, lines, weights, rotation, translation))
    h = np.zeros((6, 6))
    if not cost < np.inf:
        return rotation, translation, np.inf, h
    damping = 1e-4
    for _ in range(_ITERATIONS):
        h, g = _normal_equations(points, lines, weights, rotation, translation)
        damped = h.copy()
        for j in range(6):
            damped[j, j] += damping * h[j, j] + 1e-12
        step = np.linalg.solve(damped, -g)
        new_rotation = _rotation(step[:3]) @ rotation
        new_translation = translation + step[3:]
        new_cost = _huber(residuals(points, lines, weights, new_rotation, new_translation))
        if new_cost <= cost:
            gain = cost - new_cost
            rotation, translation, cost = new_rotation, new_translation, new_cost
            damping = max(0.1 * damping, 1e-9)
            if gain <= 1e-9 * cost + 1e-12:
                break
        else:
            damping *= 10.0
            if damping > 1e9:
                break
    h, _ = _normal_equations(points, lines, weights, rotation, translation)
    return rotation, translation, cost, h
