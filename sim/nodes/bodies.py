"""Poses of /sim/bodies as matrices."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation


def matrix_of_transform(transform: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(4, 4) of a Transform message; not finite where it is no rotation."""
    t, q = transform.translation, transform.rotation
    pose = np.eye(4)
    norm2 = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w
    valid = np.isfinite(norm2) and norm2 > 0.5
    pose[:3, :3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix() if valid else np.nan
    pose[:3, 3] = t.x, t.y, t.z
    return pose
