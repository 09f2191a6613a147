"""Tilt and height of the LiDAR's mounting, from the ground at many headings.

Sloping ground rotates in the robot's frame as the robot turns, the mounting's tilt does not: so a ride with turns
separates the two. The ground is modelled as one plane; ramps are outliers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robot_stack.mapping.params import Mount as Settings
from robot_stack.mapping.poses import Floats, rotation_of

_ROUNDS = 20
_TUKEY = 4.685  # 95 % of the efficiency of least squares on normal noise
_MAD = 1.4826


@dataclass(frozen=True, slots=True)
class Plane:
    """normal: (3,) unit, upwards. offset_m: normal @ point of the plane. rms_m: residual of its points."""

    normal: Floats
    offset_m: float
    rms_m: float


@dataclass(frozen=True, slots=True)
class Tilt:
    """rotation: (3, 3) that levels the sensor's points. height_m: of the sensor above the ground.

    vectors: (n, 2) rotation about x and y, rad, that would level each plane alone; fitted: the part explained by the
    mounting and the slope of the ground.
    """

    rotation: Floats
    deviation_rad: float
    height_m: float
    height_deviation_m: float
    ground_rms_m: float
    vectors: Floats
    fitted: Floats


def ground_plane(points: Floats, settings: Settings) -> Plane | None:
    """Fits (n, 3) points in base_link of a slightly tilted sensor; None with too few ground points.

    From near points to far ones, so that a tilt does not lift the far ground out of the band.
    """
    away = np.hypot(points[:, 0], points[:, 1])
    slope = np.zeros(3)  # z = slope @ (x, y, 1)
    design = np.column_stack([points[:, :2], np.ones(len(points))])
    band_m, rms_m = settings.band_m, 0.0
    for reach_m in np.linspace(settings.nearest_m + settings.band_m, settings.farthest_m, _ROUNDS):
        left = points[:, 2] - design @ slope
        near = (away > settings.nearest_m) & (away < reach_m) & (np.abs(left) < band_m)
        if np.count_nonzero(near) < settings.fewest_points:
            continue
        slope = np.linalg.lstsq(design[near], points[near, 2], rcond=None)[0]
        rms_m = float(np.std(points[near, 2] - design[near] @ slope))
        band_m = max(settings.narrowest_band_m, min(band_m, 3.0 * rms_m))
    if rms_m == 0.0:
        return None
    length = float(np.sqrt(1.0 + slope[0] ** 2 + slope[1] ** 2))
    return Plane(np.array([-slope[0], -slope[1], 1.0]) / length, float(slope[2]) / length, rms_m)


def tilt_of(planes: list[Plane], yaw_rad: Floats, places: float, sensor_m: Floats) -> Tilt:
    """The tilt that explains the planes (n,) seen at headings ``yaw_rad`` (n,) in odom. sensor_m: (3,) in base_link.

    places: number of independent ones among them. Raises LinAlgError if the headings do not determine the tilt.
    """
    normals = np.array([plane.normal for plane in planes])
    design = _design(yaw_rad)
    rotation, weights, left = np.eye(3), np.ones(len(planes)), np.zeros((len(planes), 2))
    for _ in range(_ROUNDS):
        vectors = _levelling(normals @ rotation.T)
        unknown = _solve(design, vectors.ravel(), np.repeat(weights, 2))
        left = (vectors.ravel() - design @ unknown).reshape(-1, 2)
        weights = _tukey(np.linalg.norm(left, axis=1))
        rotation = rotation_of(np.array([unknown[0], unknown[1], 0.0])) @ rotation
    spread = float(np.sqrt((np.repeat(weights, 2) * left.ravel() ** 2).sum() / max(2.0 * weights.sum() - 4.0, 1.0)))
    share = min(1.0, places / len(planes))
    covariance = np.linalg.inv(design.T @ (np.repeat(weights, 2)[:, None] * design)) / share
    heights = np.array([float(plane.normal @ sensor_m) - plane.offset_m for plane in planes])
    height_m = float(np.average(heights, weights=weights))
    scatter_m = float(np.sqrt(np.average((heights - height_m) ** 2, weights=weights)))
    alone = _levelling(normals)
    return Tilt(
        rotation,
        spread * float(np.sqrt(covariance[:2, :2].trace())),
        height_m,
        scatter_m / float(np.sqrt(max(share * weights.sum(), 1.0))),
        float(np.median([plane.rms_m for plane in planes])),
        alone,
        alone - left,
    )


def _design(yaw_rad: Floats) -> Floats:
    """(2 n, 4): effect of the mounting's two angles and the ground's slope in odom on the levelling of each plane."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    design = np.zeros((len(yaw_rad), 2, 4))
    design[:, 0, 0] = design[:, 1, 1] = 1.0
    # A slope of g in odom is R(-yaw) g in base_link; it is levelled by turning about (g_y, -g_x).
    design[:, 0, 2], design[:, 0, 3] = -sin, cos
    design[:, 1, 2], design[:, 1, 3] = -cos, -sin
    return design.reshape(-1, 4)


def _levelling(normals: Floats) -> Floats:
    """(n, 2) rotation about x and y that brings each normal upright."""
    sine = np.clip(np.hypot(normals[:, 0], normals[:, 1]), 1e-12, 1.0)
    angle = np.arcsin(sine) / sine
    return np.stack([normals[:, 1] * angle, -normals[:, 0] * angle], axis=1)


def _solve(design: Floats, values: Floats, weights: Floats) -> Floats:
    normal = design.T @ (weights[:, None] * design)
    if np.linalg.cond(normal) > 1e8:
        raise np.linalg.LinAlgError("all headings are similar")
    solved = np.linalg.solve(normal, design.T @ (weights * values))
    return np.asarray(solved, np.float64)


def _tukey(residuals: Floats) -> Floats:
    scale = _TUKEY * _MAD * float(np.median(residuals))
    if scale <= 0.0:
        return np.ones(len(residuals))
    weights: Floats = np.clip(1.0 - (residuals / scale) ** 2, 0.0, None) ** 2
    return weights
