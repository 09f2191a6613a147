"""The layouts of point clouds: structured arrays that are also the bytes of a PointCloud2.

All are in the frame and at the stamp named by the caller.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Points = npt.NDArray[np.void]

# One return of a LiDAR. x, y, z in m, sensor frame at the moment of this point (not de-skewed); intensity 0-255;
# ring: laser, 0 = lowest; time: s relative to the cloud's stamp, which is its newest point's time, so never positive.
SWEEP = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "ring", "time"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u2", "<f4"],
        "offsets": [0, 4, 8, 12, 16, 20],
        "itemsize": 24,
    }
)

# One obstacle point, m.
XYZ = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")])

# One point of a moving person or object, m, and its velocity over ground along the same axes, m/s.
MOVING = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("vx", "<f4"), ("vy", "<f4")])

# One person: ``robot_stack.core.people.Person``. Before the cloud's stamp, s: age, the detection; apart, the last time
# at which nothing else touched the person. x0, y0, x1, y1: box of the person's cells, NaN without one.
PEOPLE = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z", "vx", "vy", "radius", "sigma", "sigma_v", "age", "apart")]
    + [(name, "<f4") for name in ("x0", "y0", "x1", "y1")]
    + [(name, "<u4") for name in ("number", "sightings")]
    + [(name, "<u1") for name in ("walks", "walked")]
)


def xyz_of(points: Points) -> npt.NDArray[np.float32]:
    """(n, 3) view of x, y, z of a structured array that begins with them; no copy."""
    width = points.dtype.itemsize // 4
    flat: npt.NDArray[np.float32] = np.ascontiguousarray(points).view(np.float32)
    return flat.reshape(len(points), width)[:, :3]


def points_from_xyz(xyz_m: npt.NDArray[Any]) -> Points:
    """(n,) of ``XYZ`` from (n, 3) coordinates."""
    return np.ascontiguousarray(xyz_m, dtype=np.float32).view(XYZ).reshape(-1)


def moving_points(rows: npt.NDArray[Any]) -> Points:
    """(n,) of ``MOVING`` from (n, 5) rows."""
    return np.ascontiguousarray(rows, dtype=np.float32).view(MOVING).reshape(-1)


def rows_of(points: Points) -> npt.NDArray[np.float32]:
    """(n, 5) of ``MOVING``."""
    return np.ascontiguousarray(points.astype(MOVING)).view(np.float32).reshape(len(points), 5)
