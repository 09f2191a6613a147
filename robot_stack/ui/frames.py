"""Heavy data as binary frames, little endian. Byte 0: the layer's number, 1-3: zero, then the function's layout."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import Pose2
from robot_stack.ui.protocol import BINARY_LAYERS, Layer

NUMBERS = {layer: number for number, layer in enumerate(BINARY_LAYERS, start=1)}
_HEAD = struct.Struct("<BBH")
_POSE = struct.Struct("<fff")
_GRID = struct.Struct("<HHf")
_COUNT = struct.Struct("<I")
UNKNOWN = 255
# Points go in centimetres: 327 m around the robot, finer than a pixel.
_CM = 100.0


def costmap(costs: NDArray[np.int8], resolution_m: float, corner: Pose2) -> bytes:
    """costs: (rows, columns), -1 unknown, row 0 at the lowest y. corner: of cell (0, 0) in map.

    After the head: columns u16, rows u16, metres per cell f32, corner x y yaw f32, then a byte a cell, 255 unknown.
    """
    rows, columns = costs.shape
    head = _HEAD.pack(NUMBERS[Layer.COSTMAP], 0, 0) + _GRID.pack(columns, rows, resolution_m)
    return b"".join((head, _POSE.pack(corner.x, corner.y, corner.yaw), costs.astype(np.uint8).tobytes()))


def obstacles(points: NDArray[np.floating[Any]], base: Pose2, points_max: int) -> bytes:
    """points: (n, 2) in base_link, m. base: base_link in map.

    After the head: base x y yaw f32, count u32, then x and y of each point in cm, i16.
    """
    finite = points[np.isfinite(points).all(axis=1)]
    thinned = finite[:: max(1, -(-len(finite) // points_max))]
    in_cm = np.clip(np.rint(thinned * _CM), -32_768, 32_767).astype("<i2")
    head = _HEAD.pack(NUMBERS[Layer.OBSTACLES], 0, 0) + _POSE.pack(base.x, base.y, base.yaw)
    return b"".join((head, _COUNT.pack(len(in_cm)), in_cm.tobytes()))


def image(layer: Layer, jpeg: bytes) -> bytes:
    """After the head: a JPEG."""
    return _HEAD.pack(NUMBERS[layer], 0, 0) + jpeg
