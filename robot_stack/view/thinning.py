"""Thinning of sweeps for remote viewers."""

from __future__ import annotations

import numpy as np
from kiss_icp.voxelization import voxel_down_sample

from robot_stack.core.point_cloud import Points, points_from_xyz
from robot_stack.view.remote_params import RemoteCloudParams

_GROWTH = 1.25


def thinned(cloud: Points, params: RemoteCloudParams) -> Points:
    """(m,) of ``XYZ``: one point of each voxel, at most ``points_max``.

    cloud: (n,) structured array with x, y, z in m around the sensor. Points that are not finite or beyond ``range_m``
    are left out. If too many points remain, they are thinned again by larger voxels until they fit.
    """
    xyz = np.stack([cloud["x"], cloud["y"], cloud["z"]], axis=1).astype(np.float64)
    near = np.square(xyz).sum(axis=1) <= params.range_m**2  # false for NaN
    size_m = params.voxel_m
    kept = voxel_down_sample(xyz[near], size_m)
    while len(kept) > params.points_max:  # ends: voxels larger than the range are eight
        size_m *= _GROWTH
        kept = voxel_down_sample(kept, size_m)
    return points_from_xyz(kept)
