"""Voxels and stray points."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.core.geometry import Pose2
from robot_stack.perception.free_space import free_ranges
from robot_stack.perception.pipeline import shifted
from robot_stack.perception.voxel import voxels, without_strays


def test_points_of_one_voxel_become_their_centroid() -> None:
    xyz = np.array([[1.01, 0.01, 0.01], [1.03, 0.03, 0.03], [1.06, 0.01, 0.01], [-1.01, 0.0, 0.0]], np.float32)
    np.testing.assert_allclose(voxels(xyz, 0.05), [[1.02, 0.02, 0.02], [1.06, 0.01, 0.01], [-1.01, 0, 0]], atol=1e-6)


def test_voxels_keep_every_occupied_place() -> None:
    xyz = np.random.default_rng(0).uniform(-20, 20, (5000, 3)).astype(np.float32)
    found = voxels(xyz, 0.5)
    assert len(found) == len(np.unique(np.floor(xyz / np.float32(0.5)), axis=0))
    assert len(voxels(xyz[:0], 0.05)) == 0


def test_lonely_points_go_and_a_column_of_four_stays() -> None:
    pole = np.array([[5.0, 0.0, z] for z in (0.2, 0.5, 0.8, 1.1)], np.float32)
    stray = np.array([[8.0, 8.0, 1.0], [90.0, 0.0, 1.0]], np.float32)
    np.testing.assert_array_equal(without_strays(np.concatenate([stray, pole]), 25.0, 0.3, 4), pole)
    assert len(without_strays(pole[:0], 25.0, 0.3, 4)) == 0


def test_obstacles_move_with_the_robot() -> None:
    """The robot drove 1 m ahead and turned left by 90 deg: what was 3 m ahead now is 2 m to its right."""
    step = Pose2(0.0, 0.0, 0.0).relative_to(Pose2(1.0, 0.0, np.pi / 2))
    np.testing.assert_allclose(shifted(np.array([[3.0, 0.0, 0.5]], np.float32), step), [[0.0, -2.0, 0.5]], atol=1e-6)


def test_free_space_is_seen_from_base_link_and_ends_at_obstacles() -> None:
    free = np.full(360, 5.0, np.float32)
    ranges = free_ranges(free, (0.2, 0.0), np.array([[3.0, 0.01, 0.5]], np.float32), 720)
    assert ranges[360] == pytest.approx(3.0, abs=0.01)
    assert ranges[370] == pytest.approx(5.2, abs=0.02)
    assert ranges[5] == pytest.approx(4.8, abs=0.02)
    assert (ranges > 0.0).all()


def test_neighbours_of_unlike_length_leave_no_seams() -> None:
    free = np.random.default_rng(0).uniform(1.5, 20.0, 360).astype(np.float32)
    ranges = free_ranges(free, (0.2, 0.0), np.empty((0, 3), np.float32), 720)
    assert (ranges > 0.0).all()
    angles = (np.arange(720) + 0.5) * (2.0 * np.pi / 720) - np.pi
    x, y = ranges * np.cos(angles) - 0.2, ranges * np.sin(angles)
    sector = ((np.arctan2(y, x) + np.pi) * (360 / (2.0 * np.pi))).astype(int) % 360
    around = np.max([free[(sector + step) % 360] for step in range(-9, 10)], axis=0)
    assert (np.hypot(x, y) <= around + 0.05).all(), "never farther than what was seen there"


def test_what_was_not_seen_is_zero() -> None:
    free = np.full(360, 5.0, np.float32)
    free[170:190] = 0.0
    ranges = free_ranges(free, (0.2, 0.0), np.empty((0, 3), np.float32), 720)
    assert (ranges[345:375] == 0.0).all()
    assert (ranges[:300] > 0.0).all()
