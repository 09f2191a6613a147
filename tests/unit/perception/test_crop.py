"""Crop: removes points that do not belong to the environment."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from robot_stack.core.point_cloud import SWEEP, Points
from robot_stack.core.robot import Robot, load_robot
from robot_stack.perception.crop import boxes, crop
from robot_stack.perception.params import PerceptionParams

MOUNT = np.array([0.2, 0.0, 0.7], np.float32)
RANGE_M = (0.3, 60.0)
NUMBERS = st.one_of(st.floats(-100, 100, width=32), st.just(np.nan), st.just(-np.inf))


def cloud(xyz: np.ndarray) -> Points:
    points = np.zeros(len(xyz), SWEEP)
    for index, name in enumerate("xyz"):
        points[name] = xyz[:, index]
    return points


def kept(points: Points, cut: np.ndarray) -> np.ndarray:
    return crop(points, MOUNT, cut, RANGE_M)[0]


def test_points_come_out_in_base_link(robot: Robot, params: PerceptionParams) -> None:
    xyz = kept(cloud(np.array([[3.0, 1.0, -0.7]])), boxes(robot, params.crop, chair=False))
    np.testing.assert_allclose(xyz, [[3.2, 1.0, 0.0]], atol=1e-6)


def test_the_robot_and_its_chair_are_cut_out(robot: Robot, params: PerceptionParams) -> None:
    seen = np.array(
        [
            [-0.6, 0.2, -0.3],  # on the robot's back
            [0.8, 0.3, 0.3],  # passenger, x 1.0 m
            [0.8, 0.3, 1.0],  # above the passenger's head, z 1.7 m
            [1.3, 0.0, 0.3],  # in front of the chair, x 1.5 m
            [0.8, 0.5, 0.3],  # beside the chair, beyond its margin
        ]
    )
    alone = kept(cloud(seen), boxes(robot, params.crop, chair=False))
    loaded = kept(cloud(seen), boxes(robot, params.crop, chair=True))
    assert len(alone) == 4
    np.testing.assert_allclose(loaded, (seen + MOUNT)[2:], atol=1e-6)


def test_ranges_and_numbers_that_are_none_are_left_out(robot: Robot, params: PerceptionParams) -> None:
    near, far, broken = [[0.1, 0.0, 0.0]], [[70.0, 0.0, 0.0]], [[np.nan, 0.0, 0.0], [0.0, np.inf, 0.0]]
    points = cloud(np.array([*near, *far, *broken, [9.0, 0, 0], [5.0, 0.0, 0.0]]))
    points["time"][-1] = np.nan
    xyz, times, count = crop(points, MOUNT, boxes(robot, params.crop, chair=False), RANGE_M)
    assert (len(xyz), len(times), count) == (1, 1, 3)
    assert len(kept(points[:0], boxes(robot, params.crop, chair=True))) == 0


def test_points_are_read_where_they_are(robot: Robot, params: PerceptionParams) -> None:
    """Fields at other offsets and read-only bytes give the same result."""
    points = cloud(np.array([[5.0, 1.0, 0.0], [0.0, -7.0, 1.0]]))
    other = np.dtype([("flag", "u1"), ("time", "<f4"), ("z", "<f4"), ("y", "<f4"), ("x", "<f4")])
    packed = np.zeros(2, other)
    for name in ("x", "y", "z", "time"):
        packed[name] = points[name]
    packed.flags.writeable = False
    cut = boxes(robot, params.crop, chair=False)
    np.testing.assert_array_equal(kept(packed, cut), kept(points, cut))


@settings(max_examples=50, deadline=None)
@given(hnp.arrays(np.float32, (20, 3), elements=NUMBERS))
def test_remaining_points_are_finite_outside_the_boxes_and_in_range(seen: np.ndarray) -> None:
    cut = np.array([[-0.55, 0.55, -0.4, 0.4, -0.3, 1.0]], np.float32)
    xyz, _, broken = crop(cloud(seen), MOUNT, cut, RANGE_M)
    assert broken == int((~np.isfinite(seen).all(axis=1)).sum())
    assert np.isfinite(xyz).all()
    reach = np.linalg.norm((xyz - MOUNT).astype(float), axis=1)
    assert ((reach > 0.29) & (reach < 60.01)).all()
    inside = ((xyz >= cut[0, ::2]) & (xyz <= cut[0, 1::2])).all(axis=1)
    assert not inside.any()
    assert load_robot().lidar_xyz_m == (0.2, 0.0, 0.7)


def test_the_chairs_box_leans_ahead_above_its_hinge(robot: Robot, params: PerceptionParams) -> None:
    """At a crest of 10 deg the passenger's head is 0.2 m ahead of where it is on level ground."""
    lean = np.array([0.17, robot.latch.height_m], np.float32)
    front_m = robot.footprint_with_chair.front_m + params.crop.robot_margin_m
    head_m = front_m + 0.17 * (1.2 - robot.latch.height_m)
    xyz = np.array([[head_m - 0.02, 0.0, 1.2], [head_m + 0.02, 0.0, 1.2], [front_m + 0.02, 0.0, 0.1]], np.float32)
    cut = boxes(robot, params.crop, chair=True)
    points = cloud(xyz - MOUNT)
    np.testing.assert_allclose(crop(points, MOUNT, cut, RANGE_M, lean=lean)[0], xyz[1:], atol=1e-6)
    np.testing.assert_allclose(kept(points, cut), xyz, atol=1e-6)
    # The box of the robot itself does not lean.
    behind = cloud(np.array([[robot.footprint.front_m + 0.07, 0.0, 0.9]]) - MOUNT)
    alone = np.concatenate([boxes(robot, params.crop, chair=False), np.full((1, 6), 9.0, np.float32)])
    assert len(crop(behind, MOUNT, alone, (0.1, 60.0), lean=lean)[0]) == 1
