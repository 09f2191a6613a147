"""Normal distributions per voxel of points, for one cloud or gathered over many sweeps."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robot_stack.core.site_map import Cells

Floats = npt.NDArray[np.float64]

# A voxel's key is packed into one integer, 21 bits per axis: +-1 048 576 voxels.
_BITS = 21
_HALF = 1 << (_BITS - 1)
# Sums per voxel: x y z, xx xy xz yy yz zz, relative to the voxel's centre so that a far origin costs no digits.
_FIRST, _SECOND = (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)
_SUMS = 9


def voxel_keys(points: Floats, size_m: float) -> npt.NDArray[np.int64]:
    """(n,) packed keys of the voxels of (n, 3) points. Raises ValueError for points that are not finite or too far."""
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points must be (n, 3), are {points.shape}")
    if not size_m > 0.0:
        raise ValueError(f"size_m must be positive, is {size_m}")
    index = np.floor(points / size_m)
    if not (np.abs(index) < _HALF).all():  # false for NaN as well
        raise ValueError(f"points must be finite and within {_HALF * size_m:g} m of the origin")
    shifted = index.astype(np.int64) + _HALF
    packed: npt.NDArray[np.int64] = (shifted[:, 0] << (2 * _BITS)) | (shifted[:, 1] << _BITS) | shifted[:, 2]
    return packed


def unpack_keys(packed: npt.NDArray[np.int64]) -> npt.NDArray[np.int32]:
    """(n, 3) voxel indices of packed keys."""
    mask = (1 << _BITS) - 1
    parts = np.stack([packed >> (2 * _BITS), (packed >> _BITS) & mask, packed & mask], axis=1)
    return (parts - _HALF).astype(np.int32)


class CellAccumulator:
    """Gathers points of many sweeps, all in one frame.

    size_m: edge of a voxel. Memory grows with the voxels touched, not with the points.
    """

    def __init__(self, size_m: float) -> None:
        if not size_m > 0.0:
            raise ValueError(f"size_m must be positive, is {size_m}")
        self._size_m = size_m
        self._keys: npt.NDArray[np.int64] = np.empty(0, np.int64)
        self._counts: npt.NDArray[np.int64] = np.empty(0, np.int64)
        self._sums: Floats = np.empty((0, _SUMS))

    def add(self, points: Floats) -> None:
        """Adds (n, 3) points, m. Raises ValueError for points that are not finite."""
        given = np.asarray(points, np.float64)
        keys, group = np.unique(voxel_keys(given, self._size_m), return_inverse=True)
        offset = given - (unpack_keys(keys)[group] + 0.5) * self._size_m
        values = np.concatenate([offset, offset[:, _FIRST] * offset[:, _SECOND]], axis=1)
        self._merge(keys, np.bincount(group, minlength=len(keys)), _grouped(values, group, len(keys)))

    def cells(self, min_points: int) -> Cells:
        """Voxels with at least ``min_points`` (>= 2) points so far, in order of their keys."""
        if min_points < 2:
            raise ValueError(f"min_points must be at least 2, is {min_points}: one point has no covariance")
        kept = self._counts >= min_points
        key, count, sums = unpack_keys(self._keys[kept]), self._counts[kept], self._sums[kept]
        offset = sums[:, :3] / count[:, None]
        # Unbiased: divided by n - 1.
        flat = (sums[:, 3:] - count[:, None] * offset[:, _FIRST] * offset[:, _SECOND]) / (count[:, None] - 1)
        covariance = flat[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
        return Cells(self._size_m, key, (key + 0.5) * self._size_m + offset, covariance, count)

    def _merge(self, keys: npt.NDArray[np.int64], counts: npt.NDArray[np.int64], sums: Floats) -> None:
        merged, group = np.unique(np.concatenate([self._keys, keys]), return_inverse=True)
        both = np.concatenate([self._counts, counts])
        self._counts = np.bincount(group, both, len(merged)).astype(np.int64)
        self._sums = _grouped(np.concatenate([self._sums, sums]), group, len(merged))
        self._keys = merged


def cells_of(points: Floats, size_m: float, min_points: int) -> Cells:
    """The cells of one cloud: (n, 3) points in m. Raises ValueError for points that are not finite."""
    accumulator = CellAccumulator(size_m)
    accumulator.add(points)
    return accumulator.cells(min_points)


def _grouped(values: Floats, group: npt.NDArray[np.intp], groups: int) -> Floats:
    """(groups, columns) sums of the rows of each group."""
    if not len(values):
        return np.zeros((groups, values.shape[1]))
    return np.stack([np.bincount(group, column, groups) for column in values.T], axis=1)
