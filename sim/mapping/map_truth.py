"""Accuracy of a map of a simulated site: ``python -m sim.mapping.map_truth MAP WORLD``. For evaluation only."""

from __future__ import annotations

import json
import math
import sys

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.site_map import FREE, OCCUPIED, SiteMap, load_map
from sim.plant.terrain import Solid, solids
from sim.worldfile import WorldFile, load_world

F64 = NDArray[np.float64]

# Criteria of a cell on a wall: largest deviation from a plane, least extent along it, height above the roughness.
_FLAT_M, _LONG_M, _HIGH_M = 0.045, 0.12, 0.25
_REACH_M = 0.5  # farther off a cell belongs to no solid
_CLEARANCE_M = 0.15  # a cell of the grid this far inside or outside of a solid has one right answer


def wall_errors(site: SiteMap, world: WorldFile) -> F64:
    """(n,) signed distance in m of flat upright cells to the nearest upright face of the world; positive: outside."""
    cells = site.cells
    values, _ = np.linalg.eigh(cells.covariance[:, :2, :2])
    flat = (values[:, 0] < _FLAT_M**2) & (values[:, 1] > _LONG_M**2) & (cells.mean[:, 2] > _HIGH_M)
    places = cells.mean[flat, :2]
    distance = np.full(len(places), np.inf)
    for solid in solids(world):
        if solid.shape == "box" and solid.pitch_rad == 0.0 and solid.size_m[2] > _HIGH_M:
            found = _outside(places, solid)
            nearer = np.abs(found) < np.abs(distance)
            distance[nearer] = found[nearer]
    near: F64 = distance[np.abs(distance) < _REACH_M]
    return near


def wrong_cells(site: SiteMap, world: WorldFile) -> dict[str, int]:
    """Cells of the grid that contradict the world: free inside of a solid, occupied where nothing is near."""
    grid = site.grid
    rows, columns = np.indices(grid.occupancy.shape)
    x = grid.origin_x_m + (columns + 0.5) * grid.resolution_m
    y = grid.origin_y_m + (rows + 0.5) * grid.resolution_m
    places = np.stack([x.ravel(), y.ravel()], axis=1)
    nearest = np.full(len(places), np.inf)
    pits = [
        Solid(
            pit.name, "patch", "box", (pit.x_m, pit.y_m, 0.0), (0.5 * pit.length_m, 0.5 * pit.width_m, 0.0), pit.yaw_rad
        )
        for pit in world.pits
    ]
    for solid in [*pits, *(solid for solid in solids(world) if solid.kind != "patch")]:
        nearest = np.minimum(nearest, _outside(places, solid))
    tall = np.full(len(places), np.inf)
    for solid in solids(world):
        if solid.kind in ("wall", "box", "cylinder"):
            tall = np.minimum(tall, _outside(places, solid))
    value = grid.occupancy.ravel()
    return {
        "free_inside_solids": int(((value == FREE) & (tall < -_CLEARANCE_M)).sum()),
        "occupied_in_the_open": int(((value == OCCUPIED) & (nearest > _CLEARANCE_M)).sum()),
    }


def _outside(places: F64, solid: Solid) -> F64:
    """Signed distance from above to a solid's outline, negative inside."""
    x, y = places[:, 0] - solid.centre_m[0], places[:, 1] - solid.centre_m[1]
    if solid.shape == "cylinder":
        return np.asarray(np.hypot(x, y) - solid.size_m[0], np.float64)
    c, s = math.cos(solid.yaw_rad), math.sin(solid.yaw_rad)
    half_x = solid.size_m[0] * math.cos(solid.pitch_rad)
    dx, dy = np.abs(c * x + s * y) - half_x, np.abs(-s * x + c * y) - solid.size_m[1]
    outside: F64 = np.hypot(np.maximum(dx, 0.0), np.maximum(dy, 0.0)) + np.minimum(np.maximum(dx, dy), 0.0)
    return outside


def judge(site: SiteMap, world: WorldFile) -> dict[str, float]:
    """Figures of a map against the world it was made in."""
    errors = wall_errors(site, world)
    return {
        "walls": len(errors),
        "wall_mean_m": float(errors.mean()),
        "wall_rms_m": float(np.sqrt((errors**2).mean())),
        "wall_p95_m": float(np.quantile(np.abs(errors), 0.95)),
        "wall_max_m": float(np.abs(errors).max()),
        **wrong_cells(site, world),
    }


def main(arguments: list[str]) -> int:
    if len(arguments) != 2:
        print("usage: python -m sim.mapping.map_truth MAP WORLD", file=sys.stderr)
        return 2
    print(json.dumps(judge(load_map(arguments[0]), load_world(arguments[1])), indent=2))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
