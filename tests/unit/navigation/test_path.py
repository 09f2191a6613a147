"""Geometry of a plan."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.core.limits import MotionLimits
from robot_stack.navigation.limits import PlanningLimits
from robot_stack.navigation.motion import MotionState
from robot_stack.navigation.path import Path, path_of
from robot_stack.navigation.plan import plan_motion

CRUISE = MotionLimits(1.0, 1.0, 1.0, 1.0, 2.0, 2.0)
LIMITS = PlanningLimits(CRUISE, CRUISE, 1.0)


def test_straight_plan_is_sampled_at_its_spacing() -> None:
    path = path_of(plan_motion(MotionState(IDENTITY), Pose2(3.0, 4.0, 0.5), LIMITS), 0.1, 500)
    assert path.length_m == pytest.approx(5.0)
    assert np.diff(path.arc_length_m).max() < 0.13
    assert path.poses[0] == pytest.approx([0.0, 0.0, 0.0])
    assert path.poses[-1] == pytest.approx([3.0, 4.0, 0.5])
    end = path.end()
    assert (end.x, end.y, end.yaw) == pytest.approx((3.0, 4.0, 0.5))


@pytest.mark.parametrize(
    ("goal", "length_m", "poses"),
    [
        (Pose2(0.0, 0.0, 1.5), 0.0, range(11, 501)),  # a turn on the spot has poses but no length
        (Pose2(400.0, 0.0, 0.0), 400.0, range(2, 501)),  # no more poses than allowed
        (IDENTITY, 0.0, range(1, 3)),
    ],
)
def test_extreme_plans(goal: Pose2, length_m: float, poses: range) -> None:
    path = path_of(plan_motion(MotionState(IDENTITY), goal, LIMITS), 0.1, 500)
    assert path.length_m == pytest.approx(length_m)
    assert len(path.poses) in poses
    assert path.end().distance_to(goal) < 1e-6


def test_projection_beside_ahead_and_behind() -> None:
    path = Path(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.5], [1.0, 2.0, 0.5]]))
    assert path.project(0.25, 0.1) == pytest.approx((0.25, 0.1))
    assert path.project(0.25, -0.1) == pytest.approx((0.25, -0.1))
    assert path.project(1.3, 1.0) == pytest.approx((2.0, -0.3))
    along, distance = path.project(-0.3, 0.4)
    assert along == 0.0
    assert abs(distance) == pytest.approx(0.5)
    assert path.project(1.0, 3.0)[0] == pytest.approx(3.0)
    assert Path(np.array([[1.0, 1.0, 0.0]])).project(4.0, 5.0) == (0.0, pytest.approx(5.0))


def test_rounded_corner_bends_one_way() -> None:
    start = MotionState(IDENTITY, velocity=(1.0, 0.0))
    path = path_of(plan_motion(start, Pose2(2.0, 6.0, 0.0), LIMITS), 0.1, 500)
    # The total rotation is the angle between the first and the last course.
    bends = np.diff(np.unwrap(np.arctan2(np.diff(path.poses[:, 1]), np.diff(path.poses[:, 0]))))
    assert bends.min() > -1e-3
    assert 0.9 < bends.sum() < math.pi / 2.0
