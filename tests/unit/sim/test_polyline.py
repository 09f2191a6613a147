"""A line through points: positions along it and distances from it."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.geometry import Pose2
from sim.polyline import Polyline

CORNER = Polyline([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0)])


@pytest.mark.parametrize(
    ("along_m", "pose"),
    [
        (0.0, Pose2(0.0, 0.0, 0.0)),
        (4.0, Pose2(4.0, 0.0, 0.0)),
        (5.0, Pose2(4.0, 1.0, math.pi / 2)),
        (9.0, Pose2(4.0, 3.0, math.pi / 2)),
    ],
)
def test_a_pose_faces_along_the_line_and_beyond_its_end_is_its_end(along_m: float, pose: Pose2) -> None:
    assert CORNER.length_m == 7.0
    assert CORNER.pose_at(along_m) == pose


@pytest.mark.parametrize(
    ("place", "distance_m"), [((2.0, 1.0), 1.0), ((4.0, 1.5), 0.0), ((-3.0, -4.0), 5.0), ((7.0, 7.0), 5.0)]
)
def test_the_nearest_place_counts(place: tuple[float, float], distance_m: float) -> None:
    assert CORNER.distance_m(*place) == pytest.approx(distance_m)
    point = Polyline([(1.0, 2.0)])
    assert (point.length_m, point.pose_at(3.0)) == (0, Pose2(1.0, 2.0, 0.0))
    assert point.distance_m(4.0, 6.0) == pytest.approx(5.0)
