"""Moving objects: voxels that rays passed more often than they hit something in them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from robot_stack.core.compiled import compiled
from robot_stack.mapping.params import MovingObjectParams as Settings
from robot_stack.mapping.poses import Floats, transform


class Votes:
    """One vote per sweep and voxel: a hit, or else rays passed through it."""

    def __init__(self, low: Floats, high: Floats, settings: Settings) -> None:
        """low, high: (3,) corners of the evaluated box, map."""
        self._settings = settings
        self._low = low - settings.voxel_m
        shape = np.ceil((high - self._low) / settings.voxel_m).astype(np.int64) + 2
        self._mark = np.zeros(shape, np.uint8)
        self._hits = np.zeros(shape, np.uint16)
        self._through = np.zeros(shape, np.uint16)

    def add(self, origin: Floats, points: Floats) -> None:
        """(n, 3) returns in map of a sensor at ``origin``."""
        ends = (points - self._low) / self._settings.voxel_m
        start = (origin - self._low) / self._settings.voxel_m
        s = self._settings
        _vote(start, ends, s.margin_m / s.voxel_m, s.range_m / s.voxel_m, self._mark, self._hits, self._through)

    def moved(self, points: Floats) -> npt.NDArray[np.bool_]:
        """(n,) True for points in voxels that were empty more often than not."""
        index = np.floor((points - self._low) / self._settings.voxel_m).astype(np.int64)
        inside: npt.NDArray[np.bool_] = np.all((index >= 0) & (index < np.array(self._mark.shape)), axis=1)
        x, y, z = np.where(inside[:, None], index, 0).T
        through, hits = self._through[x, y, z], self._hits[x, y, z]
        s = self._settings
        empty: npt.NDArray[np.bool_] = (through >= s.fewest_through) & (through > s.through_per_hit * hits)
        return empty & inside


def votes_of(
    sweeps: Sequence[Floats], poses: Floats, sensor_m: Floats, settings: Settings, tick: Callable[[], None]
) -> Votes:
    """All sweeps (n, 3) in base_link at their poses; sensor_m: (3,) in base_link."""
    places = poses[:, :3, 3]
    reach = np.array([settings.range_m, settings.range_m, 3.0])
    votes = Votes(places.min(axis=0) - reach, places.max(axis=0) + reach, settings)
    for pose, points in zip(poses, sweeps, strict=True):
        votes.add(transform(pose, sensor_m[None])[0], transform(pose, points))
        tick()
    return votes


@compiled
def _vote(
    start: Floats,
    ends: Floats,
    margin: float,
    reach: float,
    mark: npt.NDArray[np.uint8],
    hits: npt.NDArray[np.uint16],
    through: npt.NDArray[np.uint16],
) -> None:
    """Voxel traversal of each ray (Amanatides and Woo); lengths in voxels."""
    nx, ny, nz = mark.shape
    cell, step, until, delta = np.zeros(3, np.int64), np.zeros(3, np.int64), np.zeros(3), np.zeros(3)
    mark[:] = 0
    for n in range(len(ends)):
        x, y, z = int(np.floor(ends[n, 0])), int(np.floor(ends[n, 1])), int(np.floor(ends[n, 2]))
        if 0 <= x < nx and 0 <= y < ny and 0 <= z < nz and mark[x, y, z] != 1:
            mark[x, y, z] = 1
            hits[x, y, z] += 1
    for n in range(len(ends)):
        length = 0.0
        for a in range(3):
            length += (ends[n, a] - start[a]) ** 2
        length = np.sqrt(length)
        last = min(length - margin, reach)
        if last <= 0.0:
            continue
        for a in range(3):
            direction = (ends[n, a] - start[a]) / length
            cell[a] = int(np.floor(start[a]))
            step[a] = 1 if direction > 0.0 else -1
            if direction == 0.0:
                delta[a] = until[a] = 1e30
            else:
                delta[a] = abs(1.0 / direction)
                border = cell[a] + (1.0 if direction > 0.0 else 0.0)
                until[a] = (border - start[a]) / direction
        while True:
            x, y, z = cell[0], cell[1], cell[2]
            if not (0 <= x < nx and 0 <= y < ny and 0 <= z < nz):
                break
            if mark[x, y, z] == 0:
                mark[x, y, z] = 2
                through[x, y, z] += 1
            a = 0
            if until[1] < until[a]:
                a = 1
            if until[2] < until[a]:
                a = 2
            if until[a] > last:
                break
            cell[a] += step[a]
            until[a] += delta[a]
