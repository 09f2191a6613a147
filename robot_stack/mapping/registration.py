"""Registration of a sweep to voxel distributions: points to distributions, by Gauss-Newton with a robust weight.

Each point is attracted by the distribution of its voxel, weighted by its inverse covariance, so that a wall
holds a point across and lets it slide along. Magnusson, The Three-Dimensional Normal-Distributions Transform, 2009;
the robust weight is Geman-McClure's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robot_stack.core.compiled import compiled
from robot_stack.core.site_map import Cells
from robot_stack.mapping.cells import voxel_keys
from robot_stack.mapping.poses import Floats, difference, moved, transform

# Lower bound of a surface's deviation, below the sensor's resolution, m.
_THINNEST_M = 0.02
_ROBUST = 3.0  # deviations at which a point loses half its weight
_SMALL_STEP = 2e-5  # m and rad
_INLIER = 9.0  # squared deviations
_HELD = 1e-6  # weight of the initial pose, 1/m2 and 1/rad2: directions without points do not move


@dataclass(frozen=True, slots=True)
class Target:
    """Distributions to register sweeps to: packed voxel keys (sorted), means (n, 3), inverse covariances (n, 3, 3)."""

    size_m: float
    keys: np.ndarray
    mean: Floats
    information: Floats


@dataclass(frozen=True, slots=True)
class Alignment:
    """pose: (4, 4). share: [0, 1] of the points within three deviations of a distribution."""

    pose: Floats
    share: float


def target_of(cells: Cells) -> Target:
    values, vectors = np.linalg.eigh(cells.covariance)
    inverse = 1.0 / np.maximum(values, _THINNEST_M**2)
    information = np.einsum("nij,nj,nkj->nik", vectors, inverse, vectors)
    middles: Floats = (cells.key.astype(np.float64) + 0.5) * cells.size_m
    keys = voxel_keys(middles, cells.size_m)
    order = np.argsort(keys)
    return Target(cells.size_m, keys[order], cells.mean[order], information[order])


def align(points: Floats, targets: Sequence[Target], initial: Floats, most_iterations: int = 15) -> Alignment:
    """(n, 3) points, from the coarsest target to the finest."""
    pose, inside = initial, 0
    for target in targets:
        for _ in range(most_iterations):
            at = transform(pose, points)
            index = _voxels(target, at)
            normal, pull, inside = _accumulate(points, at, pose[:3, :3], index, target.mean, target.information)
            pull = pull + _HELD * difference(initial, pose)
            step = np.linalg.solve(normal + _HELD * np.eye(6), pull).astype(np.float64, copy=False)
            pose = moved(pose, step)
            if np.abs(step).max() < _SMALL_STEP:
                break
    return Alignment(pose, inside / max(len(points), 1))


def _voxels(target: Target, points: Floats) -> np.ndarray:
    """(n,) row of each point's voxel in the target, -1 for none."""
    if not len(target.keys):
        return np.full(len(points), -1, np.int64)
    keys = voxel_keys(points, target.size_m)
    row = np.minimum(np.searchsorted(target.keys, keys), len(target.keys) - 1)
    return np.where(target.keys[row] == keys, row, -1)


@compiled
def _accumulate(
    points: Floats, at: Floats, rotation: Floats, index: np.ndarray, mean: Floats, information: Floats
) -> tuple[Floats, Floats, int]:
    """((6, 6) normal matrix, (6,) gradient, points within three deviations) of one Gauss-Newton step."""
    normal, pull, inside = np.zeros((6, 6)), np.zeros(6), 0
    jacobian = np.zeros((3, 6))
    for n in range(len(points)):
        i = index[n]
        if i < 0:
            continue
        d0, d1, d2 = at[n, 0] - mean[i, 0], at[n, 1] - mean[i, 1], at[n, 2] - mean[i, 2]
        m = information[i]
        e0 = m[0, 0] * d0 + m[0, 1] * d1 + m[0, 2] * d2
        e1 = m[1, 0] * d0 + m[1, 1] * d1 + m[1, 2] * d2
        e2 = m[2, 0] * d0 + m[2, 1] * d1 + m[2, 2] * d2
        squared = d0 * e0 + d1 * e1 + d2 * e2
        if squared < _INLIER:
            inside += 1
        root = 1.0 / (1.0 + squared / (_ROBUST * _ROBUST))
        weight = root * root
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        for r in range(3):
            a, b, c = rotation[r, 0], rotation[r, 1], rotation[r, 2]
            jacobian[r, 0], jacobian[r, 1], jacobian[r, 2] = a, b, c
            # -R [p]x
            jacobian[r, 3] = c * y - b * z
            jacobian[r, 4] = a * z - c * x
            jacobian[r, 5] = b * x - a * y
        for p in range(6):
            k0 = m[0, 0] * jacobian[0, p] + m[0, 1] * jacobian[1, p] + m[0, 2] * jacobian[2, p]
            k1 = m[1, 0] * jacobian[0, p] + m[1, 1] * jacobian[1, p] + m[1, 2] * jacobian[2, p]
            k2 = m[2, 0] * jacobian[0, p] + m[2, 1] * jacobian[1, p] + m[2, 2] * jacobian[2, p]
            pull[p] -= weight * (jacobian[0, p] * e0 + jacobian[1, p] * e1 + jacobian[2, p] * e2)
            for q in range(p, 6):
                normal[p, q] += weight * (k0 * jacobian[0, q] + k1 * jacobian[1, q] + k2 * jacobian[2, q])
    for p in range(6):
        for q in range(p):
            normal[p, q] = normal[q, p]
    return normal, pull, inside
