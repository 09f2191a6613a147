"""Obstacle points of the sweep before, in directions that this sweep does not cover."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.core.geometry import Pose2
from robot_stack.perception.polar import PI, angle_of

Float = NDArray[np.float32]


def carried(xyz: Float, step: Pose2, sensor_xy_m: tuple[float, float], covered: NDArray[np.bool_]) -> Float:
    """(m, 3) points of a frame at ``step``, in the frame ``step`` is given in: those outside the covered directions.

    covered: (sectors,) directions around the sensor, which is at sensor_xy_m in the frame ``step`` is given in.
    """
    moved = np.empty_like(xyz)
    motion = np.array([math.cos(step.yaw), math.sin(step.yaw), step.x, step.y])
    sensor = np.array(sensor_xy_m, np.float32)
    count = _carry(xyz, motion, sensor, covered, moved)
    return moved[:count]


@compiled(error_model="numpy")
def _carry(xyz: Float, motion: Any, sensor: Float, covered: Any, moved: Float) -> int:
    c, s, dx, dy = motion[0], motion[1], motion[2], motion[3]
    sectors, count = len(covered), 0
    per_rad = np.float32(sectors / (2.0 * math.pi))
    for i in range(len(xyz)):
        x = np.float32(c * xyz[i, 0] - s * xyz[i, 1] + dx)
        y = np.float32(s * xyz[i, 0] + c * xyz[i, 1] + dy)
        sector = np.int32((angle_of(y - sensor[1], x - sensor[0]) + PI) * per_rad)
        if not covered[min(sector, np.int32(sectors - 1))]:
            moved[count, 0], moved[count, 1], moved[count, 2] = x, y, xyz[i, 2]
            count += 1
    return count
