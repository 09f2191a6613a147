"""What does not belong to the world: invalid returns, the robot itself, the chair it carries."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.point_cloud import Points
from robot_stack.core.robot import Footprint, Robot
from robot_stack.perception.params import CropParams

Float = NDArray[np.float32]


def boxes(robot: Robot, params: CropParams, chair: bool) -> Float:
    """(k, 6) of x0 x1 y0 y1 z0 z1, m, base_link: what is cut out."""
    items = [_box(robot.footprint, params, params.robot_height_m)]
    if chair:
        items.append(_box(robot.footprint_with_chair, params, params.chair_height_m, robot.footprint.front_m))
    return np.array(items, dtype=np.float32)


def _box(footprint: Footprint, params: CropParams, height_m: float, from_m: float | None = None) -> list[float]:
    margin, half = params.robot_margin_m, 0.5 * footprint.width_m
    rear = footprint.rear_m if from_m is None else from_m
    return [rear - margin, footprint.front_m + margin, -half - margin, half + margin, -params.below_m, height_m]


def crop(points: Points, lidar_xyz_m: Float, cut: Float, range_m: tuple[float, float]) -> tuple[Float, Float, int]:
    """The points that belong to the world.

    points: (n,) with x, y, z, time, sensor frame (axes as base_link), m, s; read where they are, not copied.
    lidar_xyz_m: (3,) sensor in base_link. cut: (k, 6) as ``boxes`` gives. range_m: least and greatest range.
    Returns (m, 3) in base_link at each point's own moment, (m,) times, and how many points were not finite.
    """
    columns = [points[name] for name in ("x", "y", "z", "time")]
    if not all(column.flags.aligned and column.flags.writeable for column in columns):
        columns = [np.array(column) for column in columns]
    xyz = np.empty((len(points), 3), dtype=np.float32)
    times = np.empty(len(points), dtype=np.float32)
    x, y, z, time = columns
    least, greatest = np.float32(range_m[0]), np.float32(range_m[1])
    kept, broken = _crop(x, y, z, time, lidar_xyz_m, cut, least, greatest, xyz, times)
    return xyz[:kept], times[:kept], broken


@numba.njit(cache=True)
def _crop(
    x: Float,
    y: Float,
    z: Float,
    time: Float,
    mount: Float,
    cut: Float,
    least: Any,
    greatest: Any,
    xyz: Float,
    times: Float,
) -> tuple[int, int]:
    kept, broken = 0, 0
    for i in range(len(x)):
        px, py, pz = x[i], y[i], z[i]
        square = px * px + py * py + pz * pz
        if not (math.isfinite(square) and math.isfinite(time[i])):
            broken += 1
            continue
        if square < least * least or square > greatest * greatest:
            continue
        px, py, pz = px + mount[0], py + mount[1], pz + mount[2]
        inside = False
        for k in range(len(cut)):
            if cut[k, 0] <= px <= cut[k, 1] and cut[k, 2] <= py <= cut[k, 3] and cut[k, 4] <= pz <= cut[k, 5]:
                inside = True
        if not inside:
            xyz[kept, 0], xyz[kept, 1], xyz[kept, 2], times[kept] = px, py, pz, time[i]
            kept += 1
    return kept, broken
