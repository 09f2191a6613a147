"""The ground of a site: the surface connected with the driven path without a step. Heights on a 2-D grid."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_edt

from robot_stack.core.compiled import compiled
from robot_stack.mapping.cells import CellAccumulator
from robot_stack.mapping.params import GridSettings
from robot_stack.mapping.poses import Floats

Indices = npt.NDArray[np.int64]
# Height of a bin: finer than the lowest kerb, coarser than the sensor's noise.
BIN_M = 0.05
_BATCH = 200_000
_FEWEST_IN_BIN = 2


@dataclass(frozen=True, slots=True)
class Bins:
    """Points sorted into columns and bins of height: column (n, 2) and level (n,) indices, mean height, count.

    In order of column and level. Column (i, j) of x and y begins at (i, j) * resolution_m.
    """

    resolution_m: float
    column: Indices
    level: Indices
    height_m: Floats
    count: Indices


@dataclass(frozen=True, slots=True)
class Surface:
    """height_m: (columns of x, columns of y) of the ground, everywhere. reached: observed and connected to the path.

    points: number of points of each height; 0 where it comes from the driven path. first: (2,) column of entry (0, 0).
    """

    resolution_m: float
    first: Indices
    height_m: Floats
    reached: npt.NDArray[np.bool_]
    points: Indices

    def below(self, points: Floats) -> Floats:
        """(n,) height of the ground under (n, >= 2) points; outside the grid that of its border."""
        index = np.floor(points[:, :2] / self.resolution_m).astype(np.int64) - self.first
        index = np.clip(index, 0, np.array(self.height_m.shape) - 1)
        found: Floats = self.height_m[index[:, 0], index[:, 1]]
        return found


def bins_of(clouds: Iterable[Floats], resolution_m: float) -> Bins:
    """(n, 3) clouds in map."""
    scale = np.array([1.0, 1.0, resolution_m / BIN_M])
    accumulator = CellAccumulator(resolution_m)
    waiting: list[Floats] = []
    for cloud in clouds:
        waiting.append(cloud * scale)
        if sum(map(len, waiting)) > _BATCH:
            accumulator.add(np.concatenate(waiting))
            waiting = []
    if waiting:
        accumulator.add(np.concatenate(waiting))
    cells = accumulator.cells(_FEWEST_IN_BIN)
    key = cells.key.astype(np.int64)
    return Bins(resolution_m, key[:, :2], key[:, 2], cells.mean[:, 2] / scale[2], cells.count)


def surface_of(bins: Bins, way: Floats, settings: GridSettings) -> Surface:
    """way: (n, 3) points on the ground that the robot drove over, map. Raises ValueError without any ground."""
    first, shape, starts, heights, counts = _surfaces(bins, way, settings)
    seeds = np.floor(way[:, :2] / bins.resolution_m).astype(np.int64) - first
    climb = settings.slope * bins.resolution_m + 0.5 * settings.step_m
    height, chosen = np.full(shape, np.nan), np.full(shape, -1)
    _flood(height, chosen, starts, heights, seeds, way[:, 2], climb)
    reached = np.isfinite(height)
    if not reached.any():
        raise ValueError("no ground was measured under the driven path")
    near = distance_transform_edt(~reached, return_distances=False, return_indices=True)
    points = np.where(chosen >= 0, np.append(counts, 0)[chosen], 0)
    return Surface(bins.resolution_m, first, height[near[0], near[1]], reached, points)


def _surfaces(
    bins: Bins, way: Floats, settings: GridSettings
) -> tuple[Indices, tuple[int, int], Indices, Floats, Indices]:
    """(first column, shape, (columns + 1,) where each column's surfaces begin, heights of surfaces, their points).

    A surface is a run of bins one above the other; its height is the mean of its lowest points.
    """
    seen = np.concatenate([bins.column, np.floor(way[:, :2] / bins.resolution_m).astype(np.int64)])
    first = seen.min(axis=0) - 1
    shape = tuple((seen.max(axis=0) - first + 2).tolist())
    flat = np.ravel_multi_index(tuple((bins.column - first).T), shape)
    begins = np.ones(len(flat), bool)
    begins[1:] = (np.diff(flat) != 0) | (np.diff(bins.level) > 1)
    run = np.cumsum(begins) - 1
    low = bins.level - bins.level[begins][run] < max(1, round(settings.ground_band_m / BIN_M))
    count = np.bincount(run[low], bins.count[low])
    mean = np.bincount(run[low], bins.count[low] * bins.height_m[low]) / count
    enough = count >= settings.fewest_ground_points
    starts = np.searchsorted(flat[begins][enough], np.arange(shape[0] * shape[1] + 1))
    return first, (shape[0], shape[1]), starts, mean[enough], count[enough].astype(np.int64)


@compiled
def _flood(
    height: Floats,
    chosen: Indices,
    starts: Indices,
    surfaces: Floats,
    seeds: Indices,
    seed_heights: Floats,
    climb: float,
) -> None:
    """Fills ``height`` from the seeds, column by column, as long as the next surface is within ``climb``."""
    nx, ny = height.shape
    queue = np.empty(nx * ny, np.int64)
    head = tail = 0
    for n in range(len(seeds)):
        i, j = seeds[n, 0], seeds[n, 1]
        if np.isnan(height[i, j]):
            best = _nearest(surfaces, starts[i * ny + j], starts[i * ny + j + 1], seed_heights[n])
            # Where the robot drove there is ground, observed or not.
            if best >= 0 and abs(surfaces[best] - seed_heights[n]) <= climb:
                height[i, j], chosen[i, j] = surfaces[best], best
            else:
                height[i, j] = seed_heights[n]
            queue[tail] = i * ny + j
            tail += 1
    while head < tail:
        i, j = queue[head] // ny, queue[head] % ny
        head += 1
        for k in range(4):
            a, b = i + (k == 0) - (k == 1), j + (k == 2) - (k == 3)
            if not (0 <= a < nx and 0 <= b < ny) or not np.isnan(height[a, b]):
                continue
            best = _nearest(surfaces, starts[a * ny + b], starts[a * ny + b + 1], height[i, j])
            if best >= 0 and abs(surfaces[best] - height[i, j]) <= climb:
                height[a, b], chosen[a, b] = surfaces[best], best
                queue[tail] = a * ny + b
                tail += 1


@compiled
def _nearest(surfaces: Floats, begin: int, end: int, wanted: float) -> int:
    best = -1
    for s in range(begin, end):
        if best < 0 or abs(surfaces[s] - wanted) < abs(surfaces[best] - wanted):
            best = s
    return best
