"""Reduces a raw sweep to a few thousand points in base_link at the sweep's stamp."""

# mypy: disable-error-code="no-untyped-def, untyped-decorator, no-any-return"

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robot_stack.core.compiled import compiled
from robot_stack.core.point_cloud import SWEEP, Points

Floats = npt.NDArray[np.float64]

# A small table stays in the fast caches, and suffices for a sweep subsampled for matching; others are subsampled again
# in a larger one. Beyond the largest, 65,536 voxels, further ones are left out.
_TABLE_BITS = (14, 17)
_WORDS = SWEEP.itemsize // 4


def subsample(
    sweep: Points, lidar_xyz_m: Floats, motion: Floats, voxel_m: float, min_range_m: float, max_range_m: float
) -> Floats:
    """(m, 3) centroids of the voxels of ``sweep`` (SWEEP, sensor frame), in base_link at the sweep's stamp.

    lidar_xyz_m: (3,) sensor in base_link, not rotated. motion: (k, 4) rows [time s, x m, y m, yaw rad]: base_link at
    that time relative to the stamp, in base_link at the stamp; times rise. Points that are not finite, nearer than
    min_range_m (in the plane: the robot itself) or farther than max_range_m are left out. A voxel's points are measured
    within milliseconds of each other, so its centroid is moved by its mean time instead of every point by its own.
    Raises ValueError for a sweep of another layout and for motion that is not finite.
    """
    if sweep.dtype.itemsize != SWEEP.itemsize or sweep.dtype.fields != SWEEP.fields:
        raise ValueError(f"a sweep must be an array of {SWEEP}, is one of {sweep.dtype}")
    if motion.ndim != 2 or motion.shape[1] != 4 or not len(motion) or not np.isfinite(motion).all():
        raise ValueError("motion must be finite rows of time, x, y, yaw")
    if not len(sweep):
        return np.empty((0, 3))
    flat = np.ascontiguousarray(sweep).view(np.float32).reshape(len(sweep), _WORDS)
    points: Floats = np.empty((0, 3))
    for bits in _TABLE_BITS:
        points = _subsample(flat, lidar_xyz_m, motion, voxel_m, min_range_m, max_range_m, bits)
        if len(points) < _most(bits):
            break
    return points


@compiled(nogil=True)
def _most(bits: int) -> int:
    """Largest number of voxels in a table: a fuller one would be slow."""
    return 1 << (bits - 1)


@compiled(nogil=True)
def _subsample(flat, lidar, motion, voxel_m, min_range_m, max_range_m, bits) -> Floats:
    size = 1 << bits
    mask = size - 1
    limit = _most(bits)
    keys = np.full(size, -1, np.int32)
    slots = np.empty(size, np.int32)
    sums = np.zeros((limit, 5), np.float64)
    count = 0
    scale = np.float32(1.0 / voxel_m)
    near2, far2 = np.float32(min_range_m * min_range_m), np.float32(max_range_m * max_range_m)
    reach = np.float32(500.0)  # voxels: ten bits an axis
    last_key, last_slot = np.int32(-1), 0
    for i in range(flat.shape[0]):
        x, y, z, time = flat[i, 0], flat[i, 1], flat[i, 2], flat[i, 5]
        flat2 = x * x + y * y
        if not (flat2 >= near2 and flat2 + z * z <= far2 and time <= 0.0 and time > -1.0):  # false for NaN as well
            continue
        kx, ky, kz = x * scale, y * scale, z * scale
        if abs(kx) > reach or abs(ky) > reach or abs(kz) > reach:
            continue
        key = np.int32((int(kx + 512.0) << 20) | (int(ky + 512.0) << 10) | int(kz + 512.0))
        if key != last_key:
            at = ((np.int64(key) * 2654435761) >> 12) & mask
            while keys[at] != key and keys[at] != -1:
                at = (at + 1) & mask
            if keys[at] == -1:
                if count == limit:
                    continue
                keys[at] = key
                slots[at] = count
                count += 1
            last_key, last_slot = key, slots[at]
        s = sums[last_slot]
        s[0] += x
        s[1] += y
        s[2] += z
        s[3] += time
        s[4] += 1.0
    points = np.empty((count, 3))
    last = motion.shape[0] - 1
    for i in range(count):
        n = 1.0 / sums[i, 4]
        x, y, z, time = sums[i, 0] * n + lidar[0], sums[i, 1] * n + lidar[1], sums[i, 2] * n + lidar[2], sums[i, 3] * n
        k = 0
        while k < last - 1 and motion[k + 1, 0] < time:
            k += 1
        mx, my, mw = motion[k, 1], motion[k, 2], motion[k, 3]
        if last > 0:
            share = (time - motion[k, 0]) / (motion[k + 1, 0] - motion[k, 0])
            share = min(max(share, 0.0), 1.0)
            mx += share * (motion[k + 1, 1] - mx)
            my += share * (motion[k + 1, 2] - my)
            mw += share * (motion[k + 1, 3] - mw)
        c, s_ = np.cos(mw), np.sin(mw)
        points[i, 0] = mx + c * x - s_ * y
        points[i, 1] = my + s_ * x + c * y
        points[i, 2] = z
    return points
