"""Synthetic scenes: a sensor of 64 rings among boxes on a plane, cast ray by ray."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.point_cloud import SWEEP, Points

Array = NDArray[np.float64]
SENSOR_M = np.array([0.20, 0.0, 0.70])
RINGS = 64


@dataclass(frozen=True)
class Solid:
    """A box from low to high corner, m, base_link."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]


@dataclass(frozen=True)
class Slope:
    """Ground that rises (or falls) by slope_rad from x = foot_m, |y| <= half_m, for length_m along x; then level."""

    foot_m: float
    slope_rad: float
    length_m: float
    half_m: float = 100.0


def sweep(
    solids: Sequence[Solid] = (),
    slope: Slope | None = None,
    *,
    hole: tuple[float, float, float] | None = None,
    noise_m: float = 0.02,
    lost: float = 0.0,
    columns: int = 1200,
    seed: int = 0,
    ring_bias: tuple[float, float] = (0.0, 0.0),
) -> Points:
    """Returns a full turn at standstill, all times 0. hole: x0, x1 and depth of a trench without end in y.

    ring_bias: largest error of range and elevation of a ring, m and deg.
    """
    random = np.random.default_rng(seed)
    own = np.random.default_rng((seed, 1)).uniform(-1.0, 1.0, (2, RINGS))
    azimuth = np.linspace(math.pi, -math.pi, columns, endpoint=False)
    assumed = np.radians(np.linspace(-30.0, 15.0, RINGS))
    a, e = np.meshgrid(azimuth, assumed + np.radians(ring_bias[1] * own[1]), indexing="ij")
    rays = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=-1).reshape(-1, 3)
    reach = _ground(rays, slope, hole)
    for solid in solids:
        reach = np.minimum(reach, _box(rays, solid))
    seen = np.isfinite(reach) & (reach < 50.0) & (reach > 0.5) & (random.random(len(reach)) >= lost)
    reach = np.where(seen, reach, 0.0) + noise_m * random.standard_normal(len(reach))
    reach += np.tile(ring_bias[0] * own[0], columns)
    a, e = np.meshgrid(azimuth, assumed, indexing="ij")
    rays = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=-1).reshape(-1, 3)
    points = np.zeros(int(seen.sum()), SWEEP)
    for index, name in enumerate("xyz"):
        points[name] = (rays[:, index] * reach)[seen]
    points["ring"] = np.tile(np.arange(RINGS), columns)[seen]
    return points


def _ground(rays: Array, slope: Slope | None, hole: tuple[float, float, float] | None) -> Array:
    reach = _plane(rays, 0.0, 0.0, 0.0)
    if slope is not None:
        up, end_x = math.tan(slope.slope_rad), slope.foot_m + slope.length_m
        on_slope = _plane(rays, slope.foot_m, 0.0, up)
        x, y = _at(rays, on_slope)
        inside = (x >= slope.foot_m) & (x <= end_x) & (np.abs(y) <= slope.half_m)
        on_top = _plane(rays, 0.0, up * slope.length_m, 0.0)
        top_x, top_y = _at(rays, on_top)
        top = (top_x > end_x) & (np.abs(top_y) <= slope.half_m)
        base_x, base_y = _at(rays, reach)
        level = (base_x < slope.foot_m) | (np.abs(base_y) > slope.half_m)
        candidates = [
            np.where(mask, value, np.inf) for mask, value in ((level, reach), (inside, on_slope), (top, on_top))
        ]
        return np.minimum.reduce(candidates)
    if hole is not None:
        x, _ = _at(rays, reach)
        into = (x > hole[0]) & (x < hole[1])
        floor = _plane(rays, 0.0, -hole[2], 0.0)
        with np.errstate(divide="ignore"):
            wall = np.where(rays[:, 0] > 0.0, (hole[1] - SENSOR_M[0]) / rays[:, 0], np.inf)
        return np.where(into, np.minimum(floor, wall), reach)
    return reach


def _plane(rays: Array, x0: float, z0: float, up: float) -> Array:
    """Returns the range to the plane z = z0 + up * (x - x0)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = (z0 + up * (SENSOR_M[0] - x0) - SENSOR_M[2]) / (rays[:, 2] - up * rays[:, 0])
    return np.where(reach > 0.0, reach, np.inf)


def _at(rays: Array, reach: Array) -> tuple[Array, Array]:
    near = np.where(np.isfinite(reach), reach, 1e6)
    return SENSOR_M[0] + rays[:, 0] * near, SENSOR_M[1] + rays[:, 1] * near


def _box(rays: Array, solid: Solid) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        first = (np.array(solid.low) - SENSOR_M) / rays
        second = (np.array(solid.high) - SENSOR_M) / rays
    enter = np.nanmax(np.minimum(first, second), axis=1)
    leave = np.nanmin(np.maximum(first, second), axis=1)
    return np.where((enter <= leave) & (enter > 0.0), enter, np.inf)
