"""Builds a LiDAR's sweeps from its packets, and rotates the points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robot_stack.core.point_cloud import Points

F64 = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Sweep:
    """points: ``SWEEP``, in the order of time. stamp_s: the newest point's time."""

    points: Points
    stamp_s: float


def turning(rpy_deg: tuple[float, float, float], mounted: F64 | None) -> NDArray[np.float32] | None:
    """(3, 3) from the device's data to the frame in which its points are published; None without rotation.

    rpy_deg: rotation of the device's data in the sensor's axes, about its fixed x, y, z. mounted: (3, 3) from the
    sensor's own axes to those of that frame, ``Robot.to_sensor_frame``; None if they are the same.
    """
    own: F64 = Rotation.from_euler("xyz", rpy_deg, degrees=True).as_matrix()
    turned = own if mounted is None else mounted @ own
    return None if (turned == np.eye(3)).all() else turned.astype(np.float32)
