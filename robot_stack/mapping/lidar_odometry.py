"""Poses of sweeps by KISS-ICP, with wheel odometry as the initial guess.

Vizzo et al., KISS-ICP: In Defense of Point-to-Point ICP, 2023. Only points above the ground are registered: the
rings on the ground move with the sensor and bias a point-to-point match.
"""

from __future__ import annotations

import numpy as np
from kiss_icp.mapping import VoxelHashMap
from kiss_icp.registration import Registration
from kiss_icp.voxelization import voxel_down_sample

from robot_stack.mapping.params import LidarOdometry as Settings
from robot_stack.mapping.poses import Floats, inverse

# As in KISS-ICP: the map gets finer points than the match.
_MAP_SHARE, _SOURCE_SHARE = 0.5, 1.5
_CONVERGED = 1e-4


class LidarOdometry:
    """Processes sweeps in order."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._map = VoxelHashMap(settings.voxel_m, settings.max_range_m, settings.points_per_voxel)
        self._registration = Registration(settings.iterations, _CONVERGED, 1)

    def add(self, points: Floats, guess: Floats) -> tuple[Floats, bool]:
        """((4, 4) pose of this sweep, True if it was matched): (n, 3) points in base_link; guess: its expected pose."""
        s = self._settings
        standing = above_ground(points, s.ground_cell_m, s.above_ground_m)
        near = standing[(standing**2).sum(axis=1) < s.max_range_m**2]
        if len(near) < s.fewest_points:
            return guess, False
        fine = voxel_down_sample(near, s.voxel_m * _MAP_SHARE)
        matched = not self._map.empty()
        pose = guess
        if matched:
            source = voxel_down_sample(fine, s.voxel_m * _SOURCE_SHARE)
            pose = np.asarray(
                self._registration.align_points_to_map(source, self._map, guess, s.correspondence_m, s.kernel_m)
            )
        self._map.update(fine, pose)
        return pose, matched


def lidar_odometry(sweeps: list[Floats], driven: Floats, settings: Settings) -> tuple[Floats, np.ndarray]:
    """((n, 4, 4) poses, (n,) True if matched to the sweep before) of sweeps in base_link.

    driven: (n, 4, 4) poses by wheel odometry; the first is the start of the result.
    """
    odometry = LidarOdometry(settings)
    poses, matched = driven.copy(), np.zeros(len(sweeps), bool)
    for i, points in enumerate(sweeps):
        guess = driven[0] if i == 0 else poses[i - 1] @ inverse(driven[i - 1]) @ driven[i]
        poses[i], matched[i] = odometry.add(points, guess)
    return poses, matched


def above_ground(points: Floats, cell_m: float, height_m: float) -> Floats:
    """Points higher than ``height_m`` above the lowest point of their neighbourhood, 3 x 3 cells."""
    index = np.floor(points[:, :2] / cell_m).astype(np.int64)
    index -= index.min(axis=0, initial=0) - 1
    shape = index.max(axis=0, initial=0) + 2
    lowest = np.full(shape, np.inf)
    np.minimum.at(lowest, (index[:, 0], index[:, 1]), points[:, 2])
    around = lowest.copy()
    for axis in (0, 1):
        around = np.minimum(around, np.minimum(np.roll(around, 1, axis), np.roll(around, -1, axis)))
    kept: Floats = points[points[:, 2] > around[index[:, 0], index[:, 1]] + height_m]
    return kept
