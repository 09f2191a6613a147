"""Registers each sweep to the map of all sweeps, which corrects the poses by the last centimetres."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from robot_stack.mapping.cells import CellAccumulator, voxel_keys
from robot_stack.mapping.params import Refinement as Settings
from robot_stack.mapping.pose_graph import Edges
from robot_stack.mapping.poses import Floats, transform
from robot_stack.mapping.registration import Target, align, target_of

_SPACING_M = 0.25


def spread(points: Floats, spacing_m: float, range_m: float) -> Floats:
    """The points (n, 3) within the range, the first of each voxel."""
    near = points[(points**2).sum(axis=1) < range_m**2]
    _, first = np.unique(voxel_keys(near, spacing_m), return_index=True)
    kept: Floats = near[np.sort(first)]
    return kept


def thinned(points: Floats, settings: Settings) -> Floats:
    """Points evenly spread over the surfaces, at most ``points`` of them, within ``range_m``."""
    chosen = spread(points, _SPACING_M, settings.range_m)
    return np.ascontiguousarray(chosen[:: max(1, -(-len(chosen) // settings.points))])


def map_of(sweeps: Sequence[Floats], poses: Floats, settings: Settings) -> list[Target]:
    """Distributions of all sweeps (n, 3) in base_link at their poses, from the coarsest to the finest."""
    accumulators = [CellAccumulator(size_m) for size_m in settings.voxels_m]
    for points, pose in zip(sweeps, poses, strict=True):
        near = points[(points**2).sum(axis=1) < settings.range_m**2]
        for accumulator in accumulators:
            accumulator.add(transform(pose, near))
    return [target_of(accumulator.cells(settings.cell_points)) for accumulator in accumulators]


def onto_map(
    thin: Sequence[Floats], poses: Floats, targets: Sequence[Target], settings: Settings, tick: Callable[[], None]
) -> Edges:
    """Poses of the sweeps matched to the map; a sweep that fits badly has none."""
    index, measured = [], []
    for i, points in enumerate(thin):
        result = align(points, targets, poses[i])
        if result.share >= settings.fewest_share:
            index.append(i)
            measured.append(result.pose)
        tick()
    deviation = [settings.deviation_m] * 3 + [settings.deviation_rad] * 3
    return Edges(
        np.full(len(index), -1),
        np.array(index, np.int64),
        np.array(measured).reshape(-1, 4, 4),
        np.tile(1.0 / np.array(deviation), (len(index), 1)),
    )
