"""A map's cells laid out for matching: a dense index over the bounding box, and precomputed values of each cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robot_stack.core.site_map import Cells

Floats = npt.NDArray[np.float64]

# Eigenvalues below this share of the largest are raised to it (Magnusson 2009, 6.2.1 takes 0.1 %): a wall thinner than
# the sensor's noise has an objective too narrow for the search to converge.
_LEAST_EIGENVALUE_RATIO = 0.01
# Directions in which a cell is thinner than this share of its width constrain the pose; along the others its surface
# continues beyond the cell, whatever its normal distribution.
_THIN_RATIO = 0.1
_MAX_VOXELS = 100_000_000
_PACKED = ([0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2])


class Field(NamedTuple):
    """Cells in the map frame; all arrays are inputs of the compiled kernels.

    size_m: edge of a voxel. corner: (3,) int64, key of the voxel at index (0, 0, 0). rows: (nx, ny, nz) int32, row of
    a voxel's cell or -1. mean: (n, 3) m. inverse: (n, 6) inverse covariance [xx, xy, xz, yy, yz, zz], 1/m2. normal:
    (n, 6) its part along the thin directions. ground: (nx, ny) m, lowest mean of the column, NaN for an empty one.
    """

    size_m: float
    corner: npt.NDArray[np.int64]
    rows: npt.NDArray[np.int32]
    mean: Floats
    inverse: Floats
    normal: Floats
    ground: Floats


def field_of(cells: Cells, min_points: int, blur_m: float = 0.0) -> Field:
    """Lays out the cells with at least ``min_points`` points, ``blur_m`` added to their spread in every direction.

    Raises ValueError for no such cell, and for a map too large.
    """
    kept = cells.count >= min_points
    if not kept.any():
        raise ValueError(f"the map has no cell of {min_points} points or more")
    key, mean = cells.key[kept].astype(np.int64), np.ascontiguousarray(cells.mean[kept])
    corner, shape = key.min(axis=0), key.max(axis=0) - key.min(axis=0) + 1
    if int(np.prod(shape)) > _MAX_VOXELS:
        raise ValueError(f"the map's box of {shape} voxels is larger than {_MAX_VOXELS}")
    index = np.full(shape, -1, np.int32)
    index[tuple((key - corner).T)] = np.arange(len(key), dtype=np.int32)
    inverse, normal = _inverses(cells.covariance[kept] + blur_m**2 * np.eye(3), cells.size_m)
    ground = _ground(key - corner, mean, shape)
    return Field(float(cells.size_m), corner, index, mean, inverse, normal, ground)


def merged(cells: Cells, size_m: float) -> Cells:
    """The same distributions in larger voxels: counts, means and covariances add up exactly.

    Raises ValueError unless ``size_m`` is a multiple of the cells' own.
    """
    factor = round(size_m / cells.size_m)
    if factor < 1 or abs(factor * cells.size_m - size_m) > 1e-6:
        raise ValueError(f"cells of {cells.size_m} m cannot be merged to {size_m} m")
    if factor == 1:
        return cells
    key, group = np.unique(np.floor_divide(cells.key, factor), axis=0, return_inverse=True)
    group = group.reshape(-1)
    weight = cells.count.astype(np.float64)
    count = np.bincount(group, weight, len(key))
    mean = np.stack([np.bincount(group, weight * axis, len(key)) for axis in cells.mean.T], axis=1) / count[:, None]
    off = cells.mean - mean[group]
    scatter = (weight - 1.0)[:, None, None] * cells.covariance + weight[:, None, None] * off[:, :, None] * off[:, None]
    total = np.zeros((len(key), 3, 3))
    np.add.at(total, group, scatter)
    covariance = total / np.maximum(count - 1.0, 1.0)[:, None, None]
    return Cells(cells.size_m * factor, key.astype(np.int32), mean, covariance, count.astype(np.int64))


def structure_of(cells: Cells, height_m: float) -> Cells:
    """The cells that lie more than ``height_m`` above the lowest of their column of the map."""
    column, group = np.unique(cells.key[:, :2], axis=0, return_inverse=True)
    lowest = np.full(len(column), np.inf)
    np.minimum.at(lowest, group.reshape(-1), cells.mean[:, 2])
    kept = cells.mean[:, 2] > lowest[group.reshape(-1)] + height_m
    return Cells(cells.size_m, cells.key[kept], cells.mean[kept], cells.covariance[kept], cells.count[kept])


def _inverses(covariance: Floats, size_m: float) -> tuple[Floats, Floats]:
    """(n, 6) each: the regularised inverse, and its part along directions much thinner than the cell."""
    value, vector = np.linalg.eigh(0.5 * (covariance + covariance.transpose(0, 2, 1)))
    # A cell whose points coincide still gets an extent: a thousandth of a full cell's variance.
    largest = np.maximum(value[:, 2], 1e-3 * size_m**2 / 12.0)
    value = np.maximum(value, _LEAST_EIGENVALUE_RATIO * largest[:, None])
    thin = value < _THIN_RATIO * largest[:, None]
    inverse = np.einsum("nik,nk,njk->nij", vector, 1.0 / value, vector)
    normal = np.einsum("nik,nk,njk->nij", vector, thin / value, vector)
    return np.ascontiguousarray(inverse[:, _PACKED[0], _PACKED[1]]), np.ascontiguousarray(
        normal[:, _PACKED[0], _PACKED[1]]
    )


def _ground(key: npt.NDArray[np.int64], mean: Floats, shape: npt.NDArray[np.int64]) -> Floats:
    ground = np.full((int(shape[0]), int(shape[1])), np.inf)
    np.minimum.at(ground, (key[:, 0], key[:, 1]), mean[:, 2])
    ground[np.isinf(ground)] = np.nan
    return ground
