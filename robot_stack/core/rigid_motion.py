"""The planar rigid motion of a body from the motions of its points.

Each point gives two rows, the x and y of its displacement or velocity: d_i = t + theta * (-y_i, x_i).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from robot_stack.core.geometry import Twist2

Vectors = Sequence[tuple[float, float]]


def rigid_fit(positions: Vectors, displacements: Vectors) -> Twist2:
    """Least squares over two distinct points at least: translation and rotation about the origin of ``positions``.

    Displacements in m give m and rad; velocities in m/s give m/s and rad/s.
    """
    n = len(positions)
    px, py = sum(x for x, _ in positions) / n, sum(y for _, y in positions) / n
    dx, dy = sum(x for x, _ in displacements) / n, sum(y for _, y in displacements) / n
    # About the centroid, translation and rotation separate.
    moment = inertia = 0.0
    for (at_x, at_y), (by_x, by_y) in zip(positions, displacements, strict=True):
        x, y = at_x - px, at_y - py
        moment += x * (by_y - dy) - y * (by_x - dx)
        inertia += x * x + y * y
    theta = moment / inertia
    return Twist2(dx + theta * py, dy - theta * px, theta)


def residuals(positions: Vectors, displacements: Vectors, motion: Twist2) -> list[float]:
    """Distance of each point's displacement from that of ``motion``, m or m/s."""
    return [
        math.hypot(dx - motion.vx + motion.omega * y, dy - motion.vy - motion.omega * x)
        for (x, y), (dx, dy) in zip(positions, displacements, strict=True)
    ]
