"""A small site of planes and sweeps of it: ground, four walls, a shed and a pillar, without symmetry."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import Pose2
from robot_stack.core.point_cloud import SWEEP, Points
from robot_stack.core.site_map import Cells
from robot_stack.localization.ndt.matcher import NdtMatcher, pose_of
from robot_stack.localization.ndt.solver import SweepSolver
from robot_stack.mapping.cells import cells_of
from tests.unit.localization.stories import params

Floats = npt.NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])
LIDAR = (0.20, 0.0, 0.70)
NOISE_M = 0.01
# (density per m2, seed) -> points of a site, (n, 3) in map.
Place = Callable[[float, int], Floats]


def surfaces(density: float, seed: int) -> Floats:
    """Returns (n, 3) points in map; density per m2."""
    random = np.random.default_rng(seed)
    parts = [_plane(random, density, (-8.0, 12.0), (-6.0, 8.0), (0.02, 0.02))]
    for x, y in (((-8.0, 12.0), (8.0, 8.0)), ((-8.0, 12.0), (-6.0, -6.0)), ((-8.0, -8.0), (-6.0, 8.0))):
        parts.append(_plane(random, density, x, y, (0.0, 2.5)))
    parts.append(_plane(random, density, (12.0, 12.0), (-6.0, 8.0), (0.0, 2.5)))
    # The shed's corner at (5, 3), the pillar at (-3, -2).
    parts.append(_plane(random, density, (5.0, 9.0), (3.0, 3.0), (0.0, 2.0)))
    parts.append(_plane(random, density, (5.0, 5.0), (3.0, 8.0), (0.0, 2.0)))
    parts.append(_plane(random, 4.0 * density, (-3.0, -2.6), (-2.0, -2.0), (0.0, 2.0)))
    parts.append(_plane(random, 4.0 * density, (-3.0, -3.0), (-2.0, -1.6), (0.0, 2.0)))
    return np.concatenate(parts)


def apron(density: float, seed: int) -> Floats:
    """The courtyard and 65 m of bare ground east of it; the last visible object from there is the wall at x = 12."""
    random = np.random.default_rng(seed + 50_000)
    open_ground = _plane(random, density, (12.0, 77.0), (-6.0, 8.0), (0.02, 0.02))
    return np.concatenate([surfaces(density, seed), open_ground])


def corridor(density: float, seed: int) -> Floats:
    """Two bare walls, 80 m long, and the ground between them."""
    random = np.random.default_rng(seed)
    return np.concatenate(
        [
            _plane(random, density, (-40.0, 40.0), (-2.0, 2.0), (0.02, 0.02)),
            _plane(random, density, (-40.0, 40.0), (2.0, 2.0), (0.0, 2.5)),
            _plane(random, density, (-40.0, 40.0), (-2.0, -2.0), (0.0, 2.5)),
        ]
    )


@cache
def cells() -> Cells:
    return cells_of(surfaces(100.0, seed=1), 0.5, 5)


@cache
def solver() -> SweepSolver:
    return SweepSolver(cells(), params().ndt, LIDAR)


def corridor_with_posts(density: float, seed: int) -> Floats:
    """The corridor with pilasters and a post: rotated by 180 deg about (10, 0) it is nearly identical."""
    random = np.random.default_rng(seed + 60_000)
    parts = [corridor(density, seed)]
    for x in 10.0 + np.array([-17.0, -11.5, -7.0, -3.0, 3.0, 7.0, 11.5, 17.0]):
        for y, out in ((1.7, 2.0), (-2.0, -1.7)):
            parts.append(_plane(random, 4.0 * density, (x, x), (y, out), (0.0, 2.5)))
    parts.append(_plane(random, 4.0 * density, (14.6, 14.6), (1.2, 2.0), (0.0, 2.5)))
    return np.concatenate(parts)


def twins(density: float, seed: int) -> Floats:
    """Two equal courtyards, 80 m apart, with a hall east of the first."""
    random = np.random.default_rng(seed + 70_000)
    other = surfaces(density, seed + 80_000) + np.array([80.0, 0.0, 0.0])
    parts = [surfaces(density, seed), other, _plane(random, density, (12.0, 72.0), (-6.0, 8.0), (0.02, 0.02))]
    parts.append(_plane(random, 4.0 * density, (22.0, 22.0), (-8.0, 10.0), (0.0, 4.0)))
    return np.concatenate(parts)


@cache
def twins_solver() -> SweepSolver:
    return SweepSolver(cells_of(twins(40.0, seed=1), 0.5, 5), params().ndt, LIDAR)


@cache
def corridor_solver() -> SweepSolver:
    return SweepSolver(cells_of(corridor_with_posts(40.0, seed=1), 0.5, 5), params().ndt, LIDAR)


@cache
def apron_solver() -> SweepSolver:
    return SweepSolver(cells_of(apron(40.0, seed=1), 0.5, 5), params().ndt, LIDAR)


def matcher() -> NdtMatcher:
    return solver().matcher


def seen_from(pose: Floats, points: Floats, range_m: float = 25.0) -> Floats:
    """Returns the (n, 3) points in base_link at ``pose`` (4, 4)."""
    local: Floats = (points - pose[:3, 3]) @ pose[:3, :3]
    return np.ascontiguousarray(local[np.linalg.norm(local, axis=1) < range_m])


def sweep_from(pose: Pose2, seed: int = 2, density: float = 12.0, place: Place = surfaces) -> Points:
    """Returns a SWEEP in the sensor frame of a robot at rest on the ground."""
    local = seen_from(pose_of(pose, 0.0, UP), place(density, seed)) - LIDAR
    sweep = np.zeros(len(local), SWEEP)
    sweep["x"], sweep["y"], sweep["z"] = local.T
    sweep["time"] = -0.1 * np.random.default_rng(seed).random(len(local))
    return sweep


def yaw_between(a: Pose2, b: Pose2) -> float:
    return abs(math.remainder(a.yaw - b.yaw, math.tau))


def _plane(
    random: np.random.Generator,
    density: float,
    x: tuple[float, float],
    y: tuple[float, float],
    z: tuple[float, float],
) -> Floats:
    sides = np.array([x, y, z])
    lengths = sides[:, 1] - sides[:, 0]
    count = round(density * float(np.prod(lengths[lengths > 0.0])))
    points: Floats = sides[:, 0] + random.random((count, 3)) * lengths + NOISE_M * random.standard_normal((count, 3))
    return points
