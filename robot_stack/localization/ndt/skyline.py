"""The structure that a sweep must show at a place of the map: an empty sweep there contradicts the place."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from robot_stack.core.site_map import Cells

Floats = npt.NDArray[np.float64]

_SECTORS = 36
# Nearer structure may lie below the lowest or above the highest ring, higher structure hangs above it.
_NEAREST_M, _HIGHEST_M = 3.0, 2.0
# Largest offset of structure from its cell's mean, and of the pose from the true one.
_MARGIN_M = 2.0


class Skyline:
    """The structure of a map above its ground. cells: those alone."""

    def __init__(self, cells: Cells, min_points: int) -> None:
        self._mean = cells.mean[cells.count >= min_points]

    def unseen_share(self, pose: Floats, standing: Floats, range_m: float, least: int) -> float:
        """Share of the directions in which the map has structure within ``range_m``, and the sweep is empty there.

        pose: (4, 4) base_link in map. standing: (n, 3) points of the sweep that stand above the ground, in base_link.
        A nearer point counts as seen: it may hide the map's structure. 0 if the map has structure in fewer than
        ``least`` of 36 directions.
        """
        local = self._mean - pose[:3, 3]
        away = np.hypot(local[:, 0], local[:, 1])
        kept = (away >= _NEAREST_M) & (away <= range_m) & (local[:, 2] <= _HIGHEST_M)
        expected = _nearest(local[kept])
        known = np.isfinite(expected)
        if np.count_nonzero(known) < least:
            return 0.0
        seen = _nearest(standing @ pose[:3, :3].T)
        return float(np.mean(seen[known] > expected[known] + _MARGIN_M))


def _nearest(points: Floats) -> Floats:
    """(36,) distance of the nearest point in each direction, infinite without one."""
    nearest = np.full(_SECTORS, np.inf)
    sector = np.floor((np.arctan2(points[:, 1], points[:, 0]) / math.tau + 0.5) * _SECTORS).astype(np.intp) % _SECTORS
    np.minimum.at(nearest, sector, np.hypot(points[:, 0], points[:, 1]))
    return nearest
