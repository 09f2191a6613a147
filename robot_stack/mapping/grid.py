"""The 2-D grid for planning: drivable ground, structure on it, steps, and unobserved cells."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.ndimage import grey_opening, label, median_filter

from robot_stack.core.site_map import FREE, OCCUPIED, UNKNOWN, Grid
from robot_stack.mapping.ground import Bins, Surface
from robot_stack.mapping.params import GridSettings
from robot_stack.mapping.poses import Floats

Mask = npt.NDArray[np.bool_]
# Neighbours that a step is looked for between: along x, along y, and both diagonals.
_DIRECTIONS = ((1, 0), (0, 1), (1, 1), (1, -1))
_OUTER = 3
_SURE = 4.0  # deviations of noise
_MEDIAN = 3


def grid_of(bins: Bins, surface: Surface, driven: Mask, settings: GridSettings) -> Grid:
    """driven: cells of the surface that the robot stood on, which must be free."""
    middles: Floats = (bins.column.astype(np.float64) + 0.5) * bins.resolution_m
    above: Floats = bins.height_m - surface.below(middles)
    i, j = (bins.column - surface.first).T
    shape = surface.height_m.shape
    standing = (above >= settings.structure_from_m) & (above <= settings.structure_to_m)
    count = np.zeros(shape, np.int64)
    np.add.at(count, (i[standing], j[standing]), bins.count[standing])
    structure = count >= settings.fewest_structure_points
    # Observed but not reachable: a kerb's top, the floor of a pit.
    seen = np.zeros(shape, bool)
    off = (np.abs(above) > settings.step_m) & (above <= settings.structure_to_m)
    seen[i[off], j[off]] = True
    sure = structure | (seen & ~surface.reached)
    blocked = sure | _in_groups(sure | steps(surface, settings) | bumps(bins, surface, settings), settings)
    occupancy = np.full(shape, UNKNOWN, np.int8)
    occupancy[surface.reached | driven] = FREE
    occupancy[blocked & ~driven] = OCCUPIED
    x, y = (surface.first * surface.resolution_m).tolist()
    return Grid(surface.resolution_m, x, y, np.ascontiguousarray(occupancy.T))


def _in_groups(found: Mask, settings: GridSettings) -> Mask:
    """Cells in connected groups: a kerb always covers several cells, noise does not."""
    groups, _ = label(found, np.ones((3, 3)))
    large = np.bincount(groups.ravel()) >= settings.fewest_cells
    large[0] = False
    kept: Mask = large[groups]
    return kept


def steps(surface: Surface, settings: GridSettings) -> Mask:
    """Cells in the middle of a step: higher on one side than on the other by more than the slope around explains.

    Heights from few points need a higher step.
    """
    height = np.where(surface.reached, surface.height_m, np.nan)
    variance = settings.noise_m**2 / np.maximum(surface.points, 1)
    found = np.zeros(height.shape, bool)
    for direction in _DIRECTIONS:
        run_m = 2.0 * surface.resolution_m * float(np.hypot(*direction))
        ahead, behind = _shifted(height, direction, 1), _shifted(height, direction, -1)
        outer = np.stack([_shifted(height, direction, _OUTER) - ahead, behind - _shifted(height, direction, -_OUTER)])
        known = np.isfinite(outer)
        slopes = np.where(known, outer, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        # Without a slope to compare with, a height that the robot may drive is no step.
        least = np.where(known.any(axis=0), settings.step_m, settings.step_m + settings.slope * run_m)
        noise = np.sqrt(_shifted(variance, direction, 1) + _shifted(variance, direction, -1))
        climb = settings.slope * run_m
        with np.errstate(invalid="ignore"):
            excess = np.abs(ahead - behind - np.clip(slopes, -climb, climb))
            found |= excess > np.maximum(least, _SURE * noise)
    return found


def bumps(bins: Bins, surface: Surface, settings: GridSettings) -> Mask:
    """Columns with a good share of points above the ground around them: kerbs without a top surface of their own."""
    size = 2 * round(0.5 * settings.bump_width_m / surface.resolution_m) + 1
    around = grey_opening(median_filter(surface.height_m, _MEDIAN), size=(size, size))
    i, j = (bins.column - surface.first).T
    above = bins.height_m - around[i, j]
    near = np.abs(above) <= settings.structure_from_m + settings.step_m
    high = near & (above > settings.bump_m)
    count, points = np.zeros(around.shape), np.zeros(around.shape)
    np.add.at(count, (i[high], j[high]), bins.count[high])
    np.add.at(points, (i[near], j[near]), bins.count[near])
    found: Mask = (count >= settings.fewest_structure_points) & (count >= settings.bump_share * points)
    return found


def driven_cells(surface: Surface, poses: Floats, half_length_m: float, half_width_m: float) -> Mask:
    """Cells under a rectangle about each of the (n, 4, 4) poses."""
    driven = np.zeros(surface.height_m.shape, bool)
    spacing = 0.5 * surface.resolution_m
    along = np.arange(-half_length_m, half_length_m + 1e-9, spacing)
    across = np.arange(-half_width_m, half_width_m + 1e-9, spacing)
    spots = np.stack([*map(np.ravel, np.meshgrid(along, across)), np.zeros(len(along) * len(across))], axis=1)
    for pose in poses:
        places = (spots @ pose[:3, :3].T + pose[:3, 3])[:, :2]
        index = np.floor(places / surface.resolution_m).astype(np.int64) - surface.first
        index = index[((index >= 0) & (index < driven.shape)).all(axis=1)]
        driven[index[:, 0], index[:, 1]] = True
    return driven


def _shifted(values: Floats, direction: tuple[int, int], by: int) -> Floats:
    """values at each cell plus ``by`` steps, NaN beyond the border."""
    shifted = np.full(values.shape, np.nan)
    (a, b), (nx, ny) = (by * direction[0], by * direction[1]), values.shape
    into = slice(max(0, -a), nx - max(0, a)), slice(max(0, -b), ny - max(0, b))
    out = slice(max(0, a), nx - max(0, -a)), slice(max(0, b), ny - max(0, -b))
    shifted[into] = values[out]
    return shifted
