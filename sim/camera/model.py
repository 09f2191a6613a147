"""A true camera: the simulation's, with small deviations from the calibrated one of the stack.

Pixel (0, 0) is the centre of the first pixel. Distortion is Brown-Conrady (k1, k2, p1, p2, k3), as OpenCV computes it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robot_stack.core.camera import Intrinsics
from robot_stack.core.compiled import compiled
from sim.camera.params import CameraParams, load_camera_params

Array = NDArray[np.float64]
_UNDISTORT_STEPS = 30


@dataclass(frozen=True, slots=True)
class TrueCamera:
    """frame: of the corresponding camera of the stack. mounting: (4, 4) optical frame in base_link."""

    frame: str
    intrinsics: Intrinsics
    mounting: Array


def draw_camera(
    frame: str, calibrated: Intrinsics, nominal_mounting: Array, params: CameraParams, random: np.random.Generator
) -> TrueCamera:
    """A camera within the tolerances of the calibrated one.

    Intrinsics are drawn uniformly within their limits; the mounting is off by exactly its limits, in random directions.
    """
    limits = params.tolerances
    focal, aspect, cx, cy = random.uniform(-1.0, 1.0, 4).tolist()
    bends = random.uniform(-1.0, 1.0, 5) * np.array(limits.distortion)
    scale = 1.0 + limits.focal_length * focal
    k1, k2, p1, p2, k3 = (np.array(calibrated.distortion) + bends).tolist()
    intrinsics = Intrinsics(
        calibrated.width,
        calibrated.height,
        calibrated.fx * scale,
        calibrated.fy * scale * (1.0 + limits.aspect * aspect),
        calibrated.cx + limits.principal_point_px * cx,
        calibrated.cy + limits.principal_point_px * cy,
        (k1, k2, p1, p2, k3),
    )
    mounting = np.array(nominal_mounting, dtype=float)
    mounting[:3, 3] += limits.position_m * _direction(random)
    turn = Rotation.from_rotvec(limits.rotation_rad * _direction(random)).as_matrix()
    mounting[:3, :3] = mounting[:3, :3] @ turn
    return TrueCamera(frame, intrinsics, mounting)


def _direction(random: np.random.Generator) -> Array:
    vector = random.standard_normal(3)
    return np.asarray(vector / np.linalg.norm(vector))


def undistort(intrinsics: Intrinsics, pixels: Array) -> Array:
    """(..., 2) pixels to (..., 2) normalized coordinates x/z, y/z of their rays, to about 1e-12."""
    flat = np.ascontiguousarray(pixels, dtype=float).reshape(-1, 2)
    out = np.empty_like(flat)
    i = intrinsics
    _undistort(flat, np.array([i.fx, i.fy, i.cx, i.cy, *i.distortion]), out)
    return out.reshape(np.shape(pixels))


@compiled
def _undistort(pixels: Array, numbers: Array, out: Array) -> None:
    """The distortion's inverse by fixed-point steps, which shrink the error tenfold or better each."""
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = numbers
    for n in range(pixels.shape[0]):
        xd, yd = (pixels[n, 0] - cx) / fx, (pixels[n, 1] - cy) / fy
        x, y = xd, yd
        for _ in range(_UNDISTORT_STEPS):
            r2 = x * x + y * y
            radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
            dx = 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
            dy = p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
            new_x, new_y = (xd - dx) / radial, (yd - dy) / radial
            step = abs(new_x - x) + abs(new_y - y)
            x, y = new_x, new_y
            if step < 1e-12:
                break
        out[n, 0], out[n, 1] = x, y


def project(intrinsics: Intrinsics, points: Array) -> Array:
    """(..., 3) points in the optical frame, z > 0, to (..., 2) pixels."""
    k1, k2, p1, p2, k3 = intrinsics.distortion
    x, y = points[..., 0] / points[..., 2], points[..., 1] / points[..., 2]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    return np.stack([intrinsics.fx * xd + intrinsics.cx, intrinsics.fy * yd + intrinsics.cy], axis=-1)


def corner_rays(intrinsics: Intrinsics) -> NDArray[np.float32]:
    """(height + 1, width + 1, 2) normalized coordinates of the corners of all pixels."""
    rows, columns = np.mgrid[0 : intrinsics.height + 1, 0 : intrinsics.width + 1]
    return undistort(intrinsics, np.stack([columns - 0.5, rows - 0.5], axis=-1)).astype(np.float32)


__all__ = ["TrueCamera", "corner_rays", "draw_camera", "load_camera_params", "project", "undistort"]
