"""Voxels, and obstacles carried over to the next sweep."""

from __future__ import annotations

import numpy as np

from robot_stack.core.geometry import Pose2
from robot_stack.perception.carry import carried
from robot_stack.perception.voxel import voxels


def test_points_of_one_voxel_become_their_centroid() -> None:
    xyz = np.array([[1.01, 0.01, 0.01], [1.03, 0.03, 0.03], [1.06, 0.01, 0.01], [-1.01, 0.0, 0.0]], np.float32)
    np.testing.assert_allclose(voxels(xyz, 0.05), [[1.02, 0.02, 0.02], [1.06, 0.01, 0.01], [-1.01, 0, 0]], atol=1e-6)


def test_voxels_keep_every_occupied_place() -> None:
    xyz = np.random.default_rng(0).uniform(-20, 20, (5000, 3)).astype(np.float32)
    found = voxels(xyz, 0.5)
    assert len(found) == len(np.unique(np.floor(xyz / np.float32(0.5)), axis=0))
    assert len(voxels(xyz[:0], 0.05)) == 0


def test_far_away_a_column_is_one_point() -> None:
    post = np.array([[9.02, 0.02, z] for z in (0.2, 0.5, 1.1)], np.float32)
    near = post - np.array([4.0, 0.0, 0.0], np.float32)
    found = voxels(np.concatenate([post, near]), 0.05, 8.0, 0.1)
    np.testing.assert_allclose(found, [[9.02, 0.02, 0.6], *near], atol=1e-6)


def test_obstacles_move_with_the_robot() -> None:
    """The robot drives 1 m ahead and turns left by 90 deg: a point 3 m ahead is then 2 m to its right."""
    step = Pose2(0.0, 0.0, 0.0).relative_to(Pose2(1.0, 0.0, np.pi / 2))
    ahead = np.array([[3.0, 0.0, 0.5]], np.float32)
    nowhere = np.zeros(360, np.bool_)
    np.testing.assert_allclose(carried(ahead, step, (0.2, 0.0), nowhere), [[0.0, -2.0, 0.5]], atol=1e-6)


def test_directions_of_this_sweep_are_not_carried_over() -> None:
    """The directions of a sensor at x = 0.2 m: one of the two points is in a covered direction."""
    covered = np.zeros(360, np.bool_)
    covered[180] = True
    points = np.array([[3.0, 0.01, 0.5], [3.0, 0.5, 0.5], [0.2, -1.0, 0.5]], np.float32)
    np.testing.assert_array_equal(carried(points, Pose2(0.0, 0.0, 0.0), (0.2, 0.0), covered), points[1:])
