"""Detection range of kerbs: a robot that faces a kerb, from near to far."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_stack.perception.pipeline import Pipeline
from sim.lidar.views import sweep_at
from sim.worldfile import Box, WorldFile, load_world
from tests.benchmarks.support.ground_scenes import standing

HEIGHTS_M = (0.05, 0.08, 0.12)
WIDTHS_M = {"kerb": 0.15, "pavement": 4.0}
DISTANCES_M = tuple(np.arange(1.5, 6.01, 0.5).tolist())
_FRONT_HALF_M = 1.0
_PIECE_M = 0.1
_NEAR_EDGE_M = 0.3
_SHARE = 0.8


def kerb_ranges(pipeline: Pipeline, seeds: int, seed: int) -> dict[str, float]:
    """By kind and height: the greatest distance up to which every sweep shows 80 % of the front."""
    return {
        f"{kind}_{round(100 * height)}cm": _range(pipeline, width, height, seeds, seed)
        for kind, width in WIDTHS_M.items()
        for height in HEIGHTS_M
    }


def _range(pipeline: Pipeline, width_m: float, height_m: float, seeds: int, seed: int) -> float:
    reached = 0.0
    for distance in DISTANCES_M:
        world = with_kerb(distance, width_m, height_m)
        if not all(seen_share(pipeline, world, distance, seed + i) >= _SHARE for i in range(seeds)):
            break
        reached = distance
    return reached


def with_kerb(distance_m: float, width_m: float, height_m: float) -> WorldFile:
    """A kerb across the way whose front is ``distance_m`` ahead of base_link."""
    box = Box(name="kerb", x_m=distance_m + 0.5 * width_m, y_m=0.0, length_m=width_m, width_m=6.0, height_m=height_m)
    return load_world("flat").model_copy(update={"kerbs": [box]})


def seen_share(pipeline: Pipeline, world: WorldFile, distance_m: float, seed: int) -> float:
    """Share of 0.1 m pieces of the front, 2 m wide, with an obstacle point at most 0.3 m behind it."""
    points, _ = sweep_at(world, standing(0.0, 0.0, 0.0), seed=seed)
    return front_share(obstacles(pipeline, points), distance_m)


def obstacles(pipeline: Pipeline, points: NDArray[np.void]) -> NDArray[np.float32]:
    pipeline.forget()
    return pipeline.scene(points, 0.0).obstacles


def front_share(xyz: NDArray[np.float32], distance_m: float) -> float:
    near = xyz[(xyz[:, 0] > distance_m - 0.1) & (xyz[:, 0] < distance_m + _NEAR_EDGE_M)]
    pieces = np.unique(np.floor(near[np.abs(near[:, 1]) < _FRONT_HALF_M, 1] / _PIECE_M))
    return len(pieces) / (2.0 * _FRONT_HALF_M / _PIECE_M)
