"""Poses in space as (4, 4) matrices and (n, 4, 4) stacks of them. Lengths in m, rotation vectors in rad."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

Floats = npt.NDArray[np.float64]


def pose_of(translation_m: Floats, rotation: Floats) -> Floats:
    """(..., 4, 4) from (..., 3) and (..., 3, 3)."""
    poses = np.zeros((*translation_m.shape[:-1], 4, 4))
    poses[..., :3, :3], poses[..., :3, 3], poses[..., 3, 3] = rotation, translation_m, 1.0
    return poses


def planar(x_m: float, y_m: float, yaw_rad: float) -> Floats:
    return pose_of(np.array([x_m, y_m, 0.0]), rotation_of(np.array([0.0, 0.0, yaw_rad])))


def rotation_of(vector_rad: Floats) -> Floats:
    """(..., 3, 3) of (..., 3) rotation vectors."""
    flat: Floats = Rotation.from_rotvec(vector_rad.reshape(-1, 3)).as_matrix()
    return flat.reshape(*vector_rad.shape[:-1], 3, 3)


def vector_of(rotation: Floats) -> Floats:
    """(..., 3) rotation vectors of (..., 3, 3)."""
    flat: Floats = Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_rotvec()
    return flat.reshape(*rotation.shape[:-2], 3)


def from_angles(roll_rad: Floats, pitch_rad: Floats, yaw_rad: Floats) -> Floats:
    """(n, 3, 3): yaw about z, then pitch about y, then roll about x, each of the turned frame."""
    angles = np.stack(np.broadcast_arrays(yaw_rad, pitch_rad, roll_rad), axis=-1)
    rotation: Floats = Rotation.from_euler("ZYX", angles.reshape(-1, 3)).as_matrix()
    return rotation


def yaw_of(poses: Floats) -> Floats:
    """(...,) yaw of (..., 4, 4)."""
    yaw: Floats = np.arctan2(poses[..., 1, 0], poses[..., 0, 0])
    return yaw


def inverse(poses: Floats) -> Floats:
    turned = np.swapaxes(poses[..., :3, :3], -1, -2)
    return pose_of(-np.einsum("...ij,...j->...i", turned, poses[..., :3, 3]), turned)


def transform(pose: Floats, points: Floats) -> Floats:
    """(n, 3) points transformed by one pose."""
    moved: Floats = points @ pose[:3, :3].T + pose[:3, 3]
    return moved


def skew(vectors: Floats) -> Floats:
    """(..., 3, 3) matrices of the cross product."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = [zero, -z, y, z, zero, -x, -y, x, zero]
    return np.stack(rows, axis=-1).reshape(*vectors.shape[:-1], 3, 3)


def moved(poses: Floats, steps: Floats) -> Floats:
    """Poses after small steps (..., 6) in their own frames: translation, then rotation vector."""
    rotation = poses[..., :3, :3]
    shift = np.einsum("...ij,...j->...i", rotation, steps[..., :3])
    return pose_of(poses[..., :3, 3] + shift, rotation @ rotation_of(steps[..., 3:]))


def difference(poses: Floats, reference: Floats) -> Floats:
    """(..., 6): translation and rotation vector from ``reference`` to ``poses``, in the frame of ``reference``."""
    relative = inverse(reference) @ poses
    return np.concatenate([relative[..., :3, 3], vector_of(relative[..., :3, :3])], axis=-1)
