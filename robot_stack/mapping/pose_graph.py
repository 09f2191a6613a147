"""Pose graph optimisation in SE(3), by Gauss-Newton on the sparse normal equations.

Grisetti, Kuemmerle, Stachniss, Burgard: A Tutorial on Graph-Based SLAM, 2010. Robust weights after Cauchy.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

from robot_stack.mapping.poses import Floats, moved, skew, vector_of

Indices = npt.NDArray[np.int64]
_SMALL_STEP = 1e-6
_EPSILON = 1e-9  # keeps unconstrained poses in place


@dataclass(frozen=True, slots=True)
class Edges:
    """Measurements of pose ``second`` relative to pose ``first``: measured (n, 4, 4), weight (n, 6) in 1/deviation.

    first = -1: measured in the frame of the map. robust: deviations beyond which an edge loses weight; inf: never.
    """

    first: Indices
    second: Indices
    measured: Floats
    weight: Floats
    robust: float = np.inf

    def moved_by(self, count: int) -> Edges:
        """The same edges, of poses with ``count`` others before them."""
        return replace(self, first=np.where(self.first < 0, -1, self.first + count), second=self.second + count)


@dataclass(frozen=True, slots=True)
class Levels:
    """The direction of up, (n, 3) unit vectors in the frames of poses ``index``; weight in 1/rad."""

    index: Indices = field(default_factory=lambda: np.empty(0, np.int64))
    up: Floats = field(default_factory=lambda: np.empty((0, 3)))
    weight: float = 1.0


def solve(poses: Floats, edges: list[Edges], levels: Levels, most_iterations: int = 20) -> Floats:
    """(n, 4, 4) poses that agree best with all measurements, starting at the given ones."""
    for _ in range(most_iterations):
        system = _System(len(poses))
        for group in edges:
            _add_edges(system, poses, group)
        _add_levels(system, poses, levels)
        steps = system.solve()
        poses = moved(poses, steps)
        if np.abs(steps).max() < _SMALL_STEP:
            break
    return poses


def errors(poses: Floats, edges: Edges) -> Floats:
    """(n, 6) errors of the edges, translation m and rotation rad, in the measured frames."""
    return _linear(poses, edges)[0]


class _System:
    def __init__(self, count: int) -> None:
        self._size = 6 * count
        self._rows: list[Indices] = []
        self._columns: list[Indices] = []
        self._values: list[Floats] = []
        self._residual: list[Floats] = []
        self._height = 0

    def add(self, residual: Floats, blocks: list[tuple[Indices, Floats]]) -> None:
        """residual (n, k) and blocks (pose of each row or -1, (n, k, 6)), all weighed."""
        count, k = residual.shape
        rows = self._height + np.arange(count * k).reshape(count, k)
        for pose, block in blocks:
            used = pose >= 0
            columns = 6 * pose[used, None] + np.arange(6)
            shape = (int(used.sum()), k, 6)
            self._rows.append(np.broadcast_to(rows[used][:, :, None], shape).ravel())
            self._columns.append(np.broadcast_to(columns[:, None, :], shape).ravel())
            self._values.append(block[used].ravel())
        self._residual.append(residual.ravel())
        self._height += count * k

    def solve(self) -> Floats:
        values = np.concatenate(self._values)
        places = (np.concatenate(self._rows), np.concatenate(self._columns))
        jacobian = coo_matrix((values, places), (self._height, self._size)).tocsc()
        normal = (jacobian.T @ jacobian).tocsc()
        normal.setdiag(normal.diagonal() + _EPSILON)
        steps: Floats = spsolve(normal, -(jacobian.T @ np.concatenate(self._residual)))
        return steps.reshape(-1, 6)


def _linear(poses: Floats, edges: Edges) -> tuple[Floats, Floats, Floats]:
    """(residuals (n, 6), Jacobians (n, 6, 6) with respect to the steps of first and of second)."""
    fixed = edges.first < 0
    origin = np.where(fixed[:, None, None], np.eye(4), poses[edges.first])
    ri, rj, rz = origin[:, :3, :3], poses[edges.second, :3, :3], edges.measured[:, :3, :3]
    back, between = np.swapaxes(rz, 1, 2), np.swapaxes(ri, 1, 2) @ rj
    way = np.einsum("nji,nj->ni", ri, poses[edges.second, :3, 3] - origin[:, :3, 3])
    turn = back @ between
    residual = np.concatenate([np.einsum("nij,nj->ni", back, way - edges.measured[:, :3, 3]), vector_of(turn)], axis=1)
    by_first, by_second = np.zeros((2, len(way), 6, 6))
    by_first[:, :3, :3], by_first[:, :3, 3:], by_first[:, 3:, 3:] = -back, back @ skew(way), -np.swapaxes(between, 1, 2)
    by_second[:, :3, :3], by_second[:, 3:, 3:] = turn, np.eye(3)
    return residual, by_first, by_second


def _add_edges(system: _System, poses: Floats, edges: Edges) -> None:
    if not len(edges.first):
        return
    residual, by_first, by_second = _linear(poses, edges)
    squared = ((edges.weight * residual) ** 2).sum(axis=1)
    weight = edges.weight / np.sqrt(1.0 + squared / edges.robust**2)[:, None]
    blocks = [(edges.first, weight[:, :, None] * by_first), (edges.second, weight[:, :, None] * by_second)]
    system.add(weight * residual, blocks)


def _add_levels(system: _System, poses: Floats, levels: Levels) -> None:
    if not len(levels.index):
        return
    up = poses[levels.index, 2, :3]
    block = np.zeros((len(up), 3, 6))
    block[:, :, 3:] = skew(up)
    system.add(levels.weight * (up - levels.up), [(levels.index, levels.weight * block)])
