"""Patchwork++ configured for a low sensor, as a reference for the ground removal."""

from __future__ import annotations

import numpy as np
import pypatchworkpp
from numpy.typing import NDArray

Float = NDArray[np.float32]
_MIN_RANGE_M = 0.3


class Patchwork:
    """th_dist None: the default of Patchwork++, 0.125 m."""

    def __init__(self, sensor_height_m: float, th_dist_m: float | None = None, max_range_m: float = 60.0) -> None:
        params = pypatchworkpp.Parameters()
        params.verbose = False
        params.sensor_height = sensor_height_m
        params.min_range, params.max_range = _MIN_RANGE_M, max_range_m
        params.enable_RNR = False
        if th_dist_m is not None:
            params.th_dist = th_dist_m
        self._kernel = pypatchworkpp.patchworkpp(params)
        self.note = f"pypatchworkpp, sensor_height {sensor_height_m} m, min_range {_MIN_RANGE_M} m, " + (
            f"th_dist {params.th_dist:.3f} m, no noise removal (it needs intensity), else its defaults"
        )

    def ground(self, xyz: Float) -> NDArray[np.bool_]:
        """(n,) True for points (n, 3), sensor frame, that are ground."""
        self._kernel.estimateGround(np.column_stack([xyz, np.zeros(len(xyz), np.float32)]))
        found = np.zeros(len(xyz), np.bool_)
        found[np.asarray(self._kernel.getGroundIndices(), dtype=np.int64)] = True
        return found
