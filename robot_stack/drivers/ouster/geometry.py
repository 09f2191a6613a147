"""End point of a beam's range: Ouster Firmware User Manual, "Coordinate Frames and XYZ Calculation".

The head turns clockwise. In the head's frame, beam i starts at ``origin`` in the direction of its azimuth and
altitude, and its range is counted from the axis, including the distance to ``origin``. So a return at range r lies at
``direction * r + offset`` in the head, which is turned by the encoder's angle, 360 deg less a step for each column.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.drivers.ouster.metadata import Metadata

F64 = NDArray[np.float64]
_M_PER_MM = 1e-3


@dataclass(frozen=True, slots=True)
class Geometry:
    """directions: (H, 3) in the head. offsets_m: (H, 3). columns: (W, 3, 3) from the head to ``turned``'s frame.

    rings: (H,) from the lowest on, as the contract counts.
    """

    directions: F64
    offsets_m: F64
    columns: F64
    rings: NDArray[np.uint16]


def geometry_of(metadata: Metadata, turned: F64) -> Geometry:
    """turned: (3, 3) from the lidar frame, whose x looks back to the connector, to that of the points."""
    azimuth, altitude = -np.radians(metadata.beam_azimuth_angles), np.radians(metadata.beam_altitude_angles)
    level = np.cos(altitude)
    directions = np.column_stack((level * np.cos(azimuth), level * np.sin(azimuth), np.sin(altitude)))
    x_mm, z_mm = metadata.beam_origin_mm()
    origin_m = _M_PER_MM * np.array((x_mm, 0.0, z_mm))
    offsets_m = origin_m - directions * np.hypot(origin_m[0], origin_m[2])
    rings = np.empty(len(altitude), np.uint16)
    rings[np.argsort(altitude, kind="stable")] = np.arange(len(altitude))
    return Geometry(directions, offsets_m, turned @ _turns(metadata.columns_per_frame), rings)


def to_sensor(metadata: Metadata) -> tuple[F64, F64]:
    """Rotation (3, 3) and translation (3,) in m from the lidar frame to the sensor's: x ahead, origin at its base."""
    matrix = np.array(metadata.lidar_to_sensor_transform).reshape(4, 4)
    return matrix[:3, :3], _M_PER_MM * matrix[:3, 3]


def _turns(columns: int) -> F64:
    """(columns, 3, 3): the head's rotation about z."""
    angles = 2.0 * np.pi * (1.0 - np.arange(columns) / columns)
    turns = np.zeros((columns, 3, 3))
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(angles)
    turns[:, 1, 0] = np.sin(angles)
    turns[:, 0, 1] = -turns[:, 1, 0]
    turns[:, 2, 2] = 1.0
    return turns
