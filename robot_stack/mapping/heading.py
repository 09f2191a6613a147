"""Yaw of the LiDAR's mounting, from its motion compared with that of the wheels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from robot_stack.mapping.poses import Floats, inverse, yaw_of

_OUTLIER_M = 0.02
_LEVER_M = 1.0  # an error of the turn weighs as one of the way at this distance


@dataclass(frozen=True, slots=True)
class Heading:
    """yaw_rad: rotates the sensor's points into base_link. scale: ratio of the LiDAR's distance to the wheels'.
    turn_radpm: turn missing in the wheels' per metre. residuals_m: (n, 2) of the steps, along and across the path.
    """

    yaw_rad: float
    deviation_rad: float
    scale: float
    turn_radpm: float
    distance_m: float
    residuals_m: Floats


def steps_of(driven: Floats, step_m: float) -> list[tuple[int, int]]:
    """Consecutive pairs of poses (n, 4, 4) that lie ``step_m`` apart."""
    pairs, begin = [], 0
    for index in range(1, len(driven)):
        if np.linalg.norm(driven[index, :2, 3] - driven[begin, :2, 3]) >= step_m:
            pairs.append((begin, index))
            begin = index
    return pairs


def heading_of(seen: Floats, driven: Floats, sensor_m: Floats, pairs: list[tuple[int, int]]) -> Heading:
    """seen, driven: (n, 4, 4) poses of base_link by LiDAR and by wheels. sensor_m: (2,) the sensor in base_link.

    A sensor mounted with a yaw error measures base_link rotated by it: the measured step is the driven one in that
    rotated frame. If the wheels measure too little turn, their path bends by half of it; the LiDAR's own turn gives the
    amount.
    """
    first, last = (np.array([pair[k] for pair in pairs], np.intp) for k in (0, 1))
    own, wheels = inverse(seen[first]) @ seen[last], inverse(driven[first]) @ driven[last]
    way, turn = wheels[:, :2, 3], yaw_of(wheels)
    length = np.linalg.norm(way, axis=1)

    def residual(unknown: Floats) -> Floats:
        yaw, scale, more = unknown
        centre = sensor_m - _turned(np.array([yaw]), sensor_m[None])[0]
        bent = (1.0 + scale) * _turned(0.5 * more * length, way)
        moved = _turned(turn + more * length, np.tile(centre, (len(way), 1))) + bent - centre
        shift = own[:, :2, 3] - _turned(np.full(len(way), -yaw), moved)
        angle = _wrapped(yaw_of(own) - turn - more * length)
        left: Floats = np.column_stack([shift, _LEVER_M * angle])
        return left.ravel()

    found = least_squares(residual, np.zeros(3), loss="soft_l1", f_scale=_OUTLIER_M)
    left = residual(found.x)
    spread = np.sqrt((left**2).sum() / max(len(left) - 3, 1))
    deviation = spread * np.sqrt(np.linalg.inv(found.jac.T @ found.jac)[0, 0])
    along = way / length[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    rows = _turned(np.full(len(way), found.x[0]), left.reshape(-1, 3)[:, :2])
    residuals = np.stack([(rows * along).sum(axis=1), (rows * across).sum(axis=1)], axis=1)
    yaw, scale, more = map(float, found.x)
    return Heading(yaw, float(deviation), 1.0 + scale, more, float(length.sum()), residuals)


def _wrapped(angle_rad: Floats) -> Floats:
    wrapped: Floats = (angle_rad + np.pi) % (2.0 * np.pi) - np.pi
    return wrapped


def _turned(angle_rad: Floats, vectors: Floats) -> Floats:
    """(n, 2) vectors, each turned by its angle."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.stack([cos * vectors[:, 0] - sin * vectors[:, 1], sin * vectors[:, 0] + cos * vectors[:, 1]], axis=1)
