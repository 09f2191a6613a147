"""Poses of a sensor or shape on a moving body, at many times."""

from __future__ import annotations

import numpy as np

from sim.camera.motion import Track
from sim.lidar.shapes import F64
from sim.plant.interpolation import interpolate


def poses_at(track: Track, times_s: F64, mounted: F64) -> tuple[F64, F64]:
    """Positions (k, 3) and rotations (k, 3, 3) in map, at (k,) rising times, of what sits at ``mounted`` (4, 4) on the
    body: positions linear, rotations by slerp, constant before the track's first and after its last pose.
    """
    first = max(int(np.searchsorted(track.times_s, times_s[0], "right")) - 1, 0)
    last = int(np.searchsorted(track.times_s, times_s[-1], "left")) + 1
    poses = np.ascontiguousarray(track.poses[first:last])
    place, turn = np.empty((len(times_s), 3)), np.empty((len(times_s), 3, 3))
    interpolate(np.ascontiguousarray(track.times_s[first:last]), poses, times_s, mounted, place, turn)
    return place, turn
