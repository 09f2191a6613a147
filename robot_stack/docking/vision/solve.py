"""Least squares of a rigid pose against fitted lines: Levenberg-Marquardt with Huber's weights, compiled.

A line fitted to evenly spread edge samples is known best, and independently, at its two Gauss points: +-1 / sqrt(3) of
half its length from the middle, each with the variance 2 s^2 / n. The model's points there must lie on the line; so
nothing of the samples is lost, and a side is used even where its neighbour cannot be seen.

A pose is (R, t): x_camera = R x_object + t. Small changes (w, d) act as exp(w) R x + t + d. With a rolling shutter a
point is seen by its row's time: ``late`` seconds after the pose's, at x + late (w x x + u) for the twist (w, u) of the
object in the camera frame.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled

Array = NDArray[np.float64]

_ITERATIONS = 30
_HUBER = 2.5  # standard deviations


@compiled
def _rotation(w: Array) -> Array:
    """exp of a rotation vector (Rodrigues)."""
    angle = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    first, second = 1.0, 0.5
    if angle > 1e-6:
        first, second = math.sin(angle) / angle, (1.0 - math.cos(angle)) / (angle * angle)
    turn = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            turn[i, j] = second * w[i] * w[j]
        turn[i, i] += 1.0 - second * angle * angle
    turn[0, 1] -= first * w[2]
    turn[0, 2] += first * w[1]
    turn[1, 0] += first * w[2]
    turn[1, 2] -= first * w[0]
    turn[2, 0] -= first * w[1]
    turn[2, 1] += first * w[0]
    return turn


@compiled
def _product(a: Array, b: Array) -> Array:
    """(3, 3) a b."""
    out = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                out[i, j] += a[i, k] * b[k, j]
    return out


@compiled
def _apply(rotation: Array, point: Array) -> tuple[float, float, float]:
    """rotation point."""
    x, y, z = point[0], point[1], point[2]
    return (
        rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z,
        rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z,
        rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z,
    )


@compiled
def _solve_normal(h: Array, g: Array, out: Array) -> bool:
    """out = -h^-1 g by Cholesky's decomposition; False if h is not positive definite."""
    n = h.shape[0]
    low = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            total = h[i, j]
            for k in range(j):
                total -= low[i, k] * low[j, k]
            if i == j:
                if not total > 0.0:
                    return False
                low[i, i] = math.sqrt(total)
            else:
                low[i, j] = total / low[j, j]
    for i in range(n):
        total = -g[i]
        for k in range(i):
            total -= low[i, k] * out[k]
        out[i] = total / low[i, i]
    for i in range(n - 1, -1, -1):
        total = out[i]
        for k in range(i + 1, n):
            total -= low[k, i] * out[k]
        out[i] = total / low[i, i]
    return True


@compiled
def _moved(p: tuple[float, float, float], late: float, twist: Array) -> tuple[float, float, float]:
    """A point of the camera frame, moved on by a twist for a short time."""
    x, y, z = p
    return (
        x + late * (twist[1] * z - twist[2] * y + twist[3]),
        y + late * (twist[2] * x - twist[0] * z + twist[4]),
        z + late * (twist[0] * y - twist[1] * x + twist[5]),
    )


@compiled
def residuals(
    points: Array, lines: Array, weights: Array, late: Array, twist: Array, rotation: Array, translation: Array
) -> Array:
    """(n,) distances of projected points from their lines in standard deviations; NaN behind the camera."""
    out = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        qx, qy, qz = _apply(rotation, points[i])
        px, py, pz = _moved((qx + translation[0], qy + translation[1], qz + translation[2]), late[i], twist)
        if pz > 1e-6:
            out[i] = weights[i] * ((lines[i, 0] * px + lines[i, 1] * py) / pz - lines[i, 2])
        else:
            out[i] = np.nan
    return out


@compiled
def _huber(r: Array) -> float:
    """Huber's cost; infinite with a NaN."""
    cost = 0.0
    for value in r:
        size = abs(value)
        if not size < np.inf:
            return np.inf
        cost += size * size if size <= _HUBER else _HUBER * (2.0 * size - _HUBER)
    return cost


@compiled
def _normal_equations(
    points: Array, lines: Array, weights: Array, late: Array, twist: Array, rotation: Array, translation: Array
) -> tuple[Array, Array]:
    """Gauss-Newton's H (6, 6) and gradient (6,), with Huber's weights."""
    h, g = np.zeros((6, 6)), np.zeros(6)
    row = np.empty(6)
    for i in range(points.shape[0]):
        qx, qy, qz = _apply(rotation, points[i])
        px, py, pz = _moved((qx + translation[0], qy + translation[1], qz + translation[2]), late[i], twist)
        along = (lines[i, 0] * px + lines[i, 1] * py) / pz
        r = weights[i] * (along - lines[i, 2])
        scale = weights[i] / pz
        dx, dy, dz = scale * lines[i, 0], scale * lines[i, 1], -scale * along
        row[0], row[1], row[2] = qy * dz - qz * dy, qz * dx - qx * dz, qx * dy - qy * dx
        row[3], row[4], row[5] = dx, dy, dz
        robust = 1.0 if abs(r) <= _HUBER else _HUBER / abs(r)
        for j in range(6):
            g[j] += robust * row[j] * r
            for k in range(6):
                h[j, k] += robust * row[j] * row[k]
    return h, g


@compiled
def solve(
    points: Array, lines: Array, weights: Array, late: Array, twist: Array, rotation: Array, translation: Array
) -> tuple[Array, Array, float, Array]:
    """Refines a pose.

    points: (n, 3) in the object's frame, m. lines: (n, 3) unit normal and distance in normalised coordinates. weights:
    (n,) 1 / standard deviation. late: (n,) s. twist: (6,) of the object in the camera frame, rad/s and m/s. Returns
    (R (3, 3), t (3,), Huber cost, H (6, 6)); the cost is infinite without success.
    """
    cost = _huber(residuals(points, lines, weights, late, twist, rotation, translation))
    h = np.zeros((6, 6))
    if not cost < np.inf:
        return rotation, translation, np.inf, h
    damping = 1e-4
    step = np.zeros(6)
    for _ in range(_ITERATIONS):
        h, g = _normal_equations(points, lines, weights, late, twist, rotation, translation)
        damped = h.copy()
        for j in range(6):
            damped[j, j] += damping * h[j, j] + 1e-12
        if not _solve_normal(damped, g, step):
            break
        new_rotation = _product(_rotation(step[:3]), rotation)
        new_translation = translation + step[3:]
        new_cost = _huber(residuals(points, lines, weights, late, twist, new_rotation, new_translation))
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
    h, _ = _normal_equations(points, lines, weights, late, twist, rotation, translation)
    return rotation, translation, cost, h
