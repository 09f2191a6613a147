"""A synthetic street: a crowned road between kerbs, parked cars, poles and a hedge, cast ray by ray."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot_stack.core.point_cloud import SWEEP, Points
from tests.unit.perception.scenes import RINGS, SENSOR_M, Array, Solid, _box

CROWN, HALF_ROAD_M, KERB_M, KERB_WIDTH_M = 0.02, 3.5, 0.12, 0.15
CARS = (Solid((3.0, 1.5, 0.1), (7.2, 3.3, 1.45)), Solid((-7.0, -3.3, 0.1), (-2.8, -1.5, 1.45)))
POLES = (Solid((1.5, 3.9, -0.1), (1.6, 4.0, 3.0)), Solid((6.0, -4.1, -0.1), (6.1, -4.0, 3.0)))
HEDGE = Solid((-8.0, -5.6, -0.1), (8.0, -5.0, 1.1))
_WHEEL_M, _HEDGE_DEEP_M, _FAR_M = 0.6, 0.08, 50.0


@dataclass(frozen=True)
class Strip:
    """Ground between two y in base_link: z_m high at the first, rising by ``slope`` along y."""

    from_m: float
    to_m: float
    z_m: float
    slope: float


def sweep(seed: int, ring_bias: tuple[float, float], aside_m: float = 0.0, columns: int = 2344) -> Points:
    """Returns a full turn of a robot that stands on the road, with the plane of its wheels on the road's surface.

    ring_bias: as in ``scenes.sweep``. aside_m: offset to the left of the crown, on the plane of the road's left.
    """
    random = np.random.default_rng(seed)
    own = np.random.default_rng((seed, 1)).uniform(-1.0, 1.0, (2, RINGS))
    azimuth = np.linspace(math.pi, -math.pi, columns, endpoint=False)
    assumed = np.radians(np.linspace(-30.0, 15.0, RINGS))
    true = _rays(azimuth, assumed + np.radians(ring_bias[1] * own[1]))
    reach = np.minimum.reduce([_strip(true, strip) for strip in _ground(aside_m)])
    for solid in _solids(aside_m):
        reach = np.minimum(reach, _box(true, solid))
    leaves = _box(true, moved(HEDGE, aside_m)) + random.exponential(_HEDGE_DEEP_M, len(true))
    reach = np.minimum(reach, leaves)
    seen = np.isfinite(reach) & (reach < _FAR_M) & (reach > 0.5)
    reach = np.where(seen, reach, 0.0) + 0.02 * random.standard_normal(len(reach))
    reach += np.tile(ring_bias[0] * own[0], columns)
    points, rays = np.zeros(int(seen.sum()), SWEEP), _rays(azimuth, assumed)
    for index, name in enumerate("xyz"):
        points[name] = (rays[:, index] * reach)[seen]
    points["ring"] = np.tile(np.arange(RINGS), columns)[seen]
    return points


def moved(solid: Solid, aside_m: float) -> Solid:
    """Shifts a solid for a robot left of the crown. The far half of the road then falls away twice as steeply."""
    off = [0.0, -aside_m, 0.0]
    low, high = (tuple(float(a + b) for a, b in zip(corner, off, strict=True)) for corner in (solid.low, solid.high))
    return Solid((low[0], low[1], low[2]), (high[0], high[1], high[2]))


def height(y_m: float, aside_m: float = 0.0) -> float:
    """Returns the height of the road in base_link."""
    if aside_m == 0.0:
        return -CROWN * abs(y_m)
    return min(0.0, 2.0 * CROWN * (y_m + aside_m))


def _solids(aside_m: float) -> list[Solid]:
    found = [moved(solid, aside_m) for solid in (*CARS, *POLES)]
    for car in CARS:
        for x0 in (car.low[0] + 0.4, car.high[0] - 0.4 - _WHEEL_M):
            for y0 in (car.low[1], car.high[1] - 0.2):
                wheel = Solid((x0, y0, -0.3), (x0 + _WHEEL_M, y0 + 0.2, 0.6))
                found.append(moved(wheel, aside_m))
    for side in (-1.0, 1.0):
        edge = side * HALF_ROAD_M - aside_m
        y0, y1 = sorted((edge, edge + side * KERB_WIDTH_M))
        found.append(Solid((-_FAR_M, y0, -1.0), (_FAR_M, y1, height(edge, aside_m) + KERB_M)))
    return found


def _ground(aside_m: float) -> list[Strip]:
    left, right = HALF_ROAD_M - aside_m, -HALF_ROAD_M - aside_m
    own = -CROWN if aside_m == 0.0 else 0.0
    other = CROWN if aside_m == 0.0 else 2.0 * CROWN
    return [
        Strip(-aside_m, left, 0.0, own),
        Strip(right, -aside_m, height(right, aside_m), other),
        Strip(left + KERB_WIDTH_M, _FAR_M, height(left, aside_m) + KERB_M, CROWN),
        Strip(-_FAR_M, right - KERB_WIDTH_M, height(right, aside_m) + KERB_M, 0.0),
    ]


def _rays(azimuth: Array, elevation: Array) -> Array:
    a, e = np.meshgrid(azimuth, elevation, indexing="ij")
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=-1).reshape(-1, 3)


def _strip(rays: Array, strip: Strip) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        above = strip.z_m + strip.slope * (SENSOR_M[1] - strip.from_m) - SENSOR_M[2]
        reach = above / (rays[:, 2] - strip.slope * rays[:, 1])
    y = SENSOR_M[1] + rays[:, 1] * np.where(np.isfinite(reach), reach, 1e6)
    return np.where((reach > 0.0) & (y >= strip.from_m) & (y <= strip.to_m), reach, np.inf)
