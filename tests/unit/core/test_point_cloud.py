"""Layouts of point clouds and their messages."""

from __future__ import annotations

import numpy as np
import pytest

from robot_stack.core.point_cloud import SWEEP, XYZ, points_from_xyz, xyz_of
from robot_stack.middleware.point_cloud import cloud_message, fill, points_of


def some_points(count: int = 5) -> np.ndarray:
    points = np.zeros(count, SWEEP)
    points["x"], points["ring"], points["time"] = np.arange(count), np.arange(count) % 64, -0.1
    return points


def test_xyz_is_a_view_of_the_points() -> None:
    points = some_points()
    xyz_of(points)[2, 1] = 7.0
    assert points["y"][2] == 7.0
    made = points_from_xyz(np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))
    assert (made.dtype, made["z"].tolist()) == (XYZ, [3.0, 6.0])


def test_message_carries_every_field_and_is_read_in_place() -> None:
    message = cloud_message(some_points(), "lidar")
    assert (message.width, message.point_step, message.row_step) == (5, 24, 120)
    assert [(f.name, f.offset, f.datatype) for f in message.fields] == [
        ("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("intensity", 12, 7), ("ring", 16, 4), ("time", 20, 7),
    ]  # fmt: skip
    read = points_of(message, SWEEP)
    assert (read == some_points()).all()
    message.data[0:4] = message.data[24:28]
    assert read["x"][0] == 1.0
    assert points_of(message, XYZ)["x"].tolist() == [1.0, 1.0, 2.0, 3.0, 4.0], "fewer fields, found where they are"
    fill(message, some_points(0))
    assert len(points_of(message, SWEEP)) == 0


def test_clouds_that_cannot_be_read_are_refused() -> None:
    with pytest.raises(ValueError, match="field intensity is missing"):
        points_of(cloud_message(points_from_xyz(np.zeros((2, 3))), "lidar"), SWEEP)
    short = cloud_message(some_points(), "lidar")
    short.width = 6
    with pytest.raises(ValueError, match="120 bytes are not 6 points"):
        points_of(short, SWEEP)
    wrong = cloud_message(some_points(), "lidar")
    wrong.fields[0].datatype = 8
    with pytest.raises(ValueError, match="field x is not of type"):
        points_of(wrong, SWEEP)
