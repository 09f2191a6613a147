"""Removes points that are not environment: invalid returns, the robot itself, the chair it carries."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.core.point_cloud import Points
from robot_stack.core.robot import Footprint, Mast, Robot
from robot_stack.perception.params import CropParams

Float = NDArray[np.float32]

# How far ahead a box's front is for each metre above a hinge, and the height of the hinge, m.
UPRIGHT: Float = np.zeros(2, np.float32)


def boxes(robot: Robot, params: CropParams, chair: bool) -> Float:
    """(k, 6) of x0 x1 y0 y1 z0 z1, m, base_link: boxes to cut out. The robot is as high as its highest sensor."""
    highest_m = max(sensor.xyz_m[2] for sensor in robot.range_sensors.values())
    items = [_box(robot.footprint, params, max(params.robot_height_m, highest_m + params.mast_margin_m))]
    if chair:
        items.append(_box(robot.footprint_with_chair, params, params.chair_height_m, robot.footprint.front_m))
    return np.array(items, dtype=np.float32)


def _box(footprint: Footprint, params: CropParams, height_m: float, from_m: float | None = None) -> list[float]:
    margin, half = params.robot_margin_m, 0.5 * footprint.width_m
    rear = footprint.rear_m if from_m is None else from_m
    return [rear - margin, footprint.front_m + margin, -half - margin, half + margin, -params.below_m, height_m]


def crop(
    points: Points,
    lidar_xyz_m: Float,
    cut: Float,
    range_m: tuple[float, float],
    turned: Float | None = None,
    lean: Float = UPRIGHT,
) -> tuple[Float, Float, int]:
    """The points of the environment.

    points: (n,) with x, y, z, time, sensor frame, m, s; read where they are, not copied.
    lidar_xyz_m: (3,) sensor in base_link. cut: (k, 6) as ``boxes`` gives. range_m: least and greatest range.
    turned: (3, 3) from the sensor's axes to base_link's; None: they are the same. lean: of the last box, see
    ``UPRIGHT``.
    Returns (m, 3) in base_link at each point's own moment, (m,) times, and how many points were not finite.
    """
    xyz = np.empty((len(points), 3), dtype=np.float32)
    times = np.empty(len(points), dtype=np.float32)
    x, y, z, time = readable(points, "x", "y", "z", "time")
    if turned is not None:
        x, y, z = turned @ np.stack([x, y, z])
    least, greatest = np.float32(range_m[0]), np.float32(range_m[1])
    kept, broken = _crop(x, y, z, time, lidar_xyz_m, cut, lean, least, greatest, xyz, times)
    return xyz[:kept], times[:kept], broken


def beside_mast(xyz: Float, sensor_xy_m: tuple[float, float], mast: Mast, margin_rad: float) -> NDArray[np.bool_]:
    """(n,) True for points (n, 3), base_link, behind the mast or right beside it, as seen from the sensor.

    A beam that hits the mast's edge reports a range between the mast and the background, where there is nothing.
    """
    away = np.array([mast.x_m - sensor_xy_m[0], mast.y_m - sensor_xy_m[1]])
    distance = float(np.hypot(*away))
    if distance <= mast.radius_m:
        return np.zeros(len(xyz), np.bool_)
    ahead = away / distance
    x, y = xyz[:, 0] - sensor_xy_m[0], xyz[:, 1] - sensor_xy_m[1]
    along, across = x * ahead[0] + y * ahead[1], np.abs(y * ahead[0] - x * ahead[1])
    widest = math.tan(min(math.asin(mast.radius_m / distance) + margin_rad, 0.5))
    hidden: NDArray[np.bool_] = (along > distance) & (across <= widest * along)
    return hidden


def readable(points: Points, *names: str) -> list[Float]:
    """Columns of points for compiled loops: without a copy unless they are unaligned or read-only."""
    columns = [points[name] for name in names]
    if all(column.flags.aligned and column.flags.writeable for column in columns):
        return columns
    return [np.array(column) for column in columns]


@compiled
def ahead_of(z: Any, lean: Float) -> Any:
    """How far a leaning box's front is ahead at the height z, m."""
    return lean[0] * max(z - lean[1], np.float32(0.0))


@compiled
def _crop(
    x: Float,
    y: Float,
    z: Float,
    time: Float,
    mount: Float,
    cut: Float,
    lean: Float,
    least: Any,
    greatest: Any,
    xyz: Float,
    times: Float,
) -> tuple[int, int]:
    kept, broken, last = 0, 0, len(cut) - 1
    reach = np.float32(0.0)  # in plan, squared: no box is farther from base_link
    for k in range(len(cut)):
        front = cut[k, 1] + (ahead_of(cut[k, 5], lean) if k == last else np.float32(0.0))
        far_x, far_y = max(abs(cut[k, 0]), abs(front)), max(abs(cut[k, 2]), abs(cut[k, 3]))
        reach = max(reach, far_x * far_x + far_y * far_y)
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
        if px * px + py * py <= reach:
            for k in range(len(cut)):
                front = cut[k, 1] + (ahead_of(pz, lean) if k == last else np.float32(0.0))
                if cut[k, 0] <= px <= front and cut[k, 2] <= py <= cut[k, 3] and cut[k, 4] <= pz <= cut[k, 5]:
                    inside = True
        if not inside:
            xyz[kept, 0], xyz[kept, 1], xyz[kept, 2], times[kept] = px, py, pz, time[i]
            kept += 1
    return kept, broken
