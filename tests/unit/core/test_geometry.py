"""Planar geometry against values computed by hand, scipy and its own inverses."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from robot_stack.core.geometry import (
    IDENTITY,
    Pose2,
    Twist2,
    covariance_of_message,
    exp_se2,
    planar_pose,
    quaternion_from_yaw,
    wrap_angle,
    yaw_from_quaternion,
)

lengths = st.floats(-100.0, 100.0)
angles = st.floats(-math.pi, math.pi, exclude_max=True)
poses = st.builds(Pose2, lengths, lengths, angles)
speeds = st.floats(-3.0, 3.0)
twists = st.builds(Twist2, speeds, speeds, speeds)


def assert_same(a: Pose2, b: Pose2, tolerance: float = 1e-9) -> None:
    assert a.distance_to(b) < tolerance
    assert abs(wrap_angle(a.yaw - b.yaw)) < tolerance


@given(st.floats(-1e4, 1e4))
def test_wrap_angle_keeps_the_direction(angle: float) -> None:
    wrapped = wrap_angle(angle)
    assert wrap_angle(math.pi) == -math.pi
    assert -math.pi <= wrapped < math.pi
    assert math.isclose(math.cos(wrapped), math.cos(angle), abs_tol=1e-9)
    assert math.isclose(math.sin(wrapped), math.sin(angle), abs_tol=1e-9)


@given(poses, poses)
def test_relative_to_undoes_compose(a: Pose2, b: Pose2) -> None:
    assert_same(a.compose(b).relative_to(a), b, 1e-7)
    assert_same(a.compose(a.inverse()), IDENTITY, 1e-7)
    assert_same(Pose2(1.0, 2.0, math.pi / 2).compose(Pose2(1.0, 0.0, 0.0)), Pose2(1.0, 3.0, math.pi / 2))


@given(twists, st.floats(0.0, 1.0))
def test_exp_matches_the_matrix_exponential(twist: Twist2, dt_s: float) -> None:
    lie = np.array([[0.0, -twist.omega, twist.vx], [twist.omega, 0.0, twist.vy], [0.0, 0.0, 0.0]]) * dt_s
    matrix = expm(lie)
    expected = Pose2(matrix[0, 2], matrix[1, 2], math.atan2(matrix[1, 0], matrix[0, 0]))
    assert_same(exp_se2(twist, dt_s), expected)


@given(angles)
def test_quaternion_round_trip_and_scipy(yaw: float) -> None:
    x, y, z, w = quaternion_from_yaw(yaw)
    assert abs(wrap_angle(yaw_from_quaternion(x, y, z, w) - yaw)) < 1e-9
    assert abs(wrap_angle(Rotation.from_quat([x, y, z, w]).as_euler("zyx")[0] - yaw)) < 1e-9


def test_the_pose_on_the_ground_of_a_robot_on_a_slope() -> None:
    x, y, z, w = Rotation.from_euler("ZYX", [0.7, 0.2, -0.1]).as_quat()
    pose = planar_pose(SimpleNamespace(x=1.0, y=2.0, z=3.0), SimpleNamespace(x=x, y=y, z=z, w=w))
    assert_same(pose, Pose2(1.0, 2.0, 0.7))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_is_finite(bad: float) -> None:
    assert Twist2(1.0, 2.0, 3.0).is_finite()
    assert Pose2(1.0, 2.0, 3.0).is_finite()
    for values in ((bad, 0.0, 0.0), (0.0, bad, 0.0), (0.0, 0.0, bad)):
        assert not Twist2(*values).is_finite()
        assert not Pose2(*values).is_finite()


def test_speed_and_scale() -> None:
    assert Twist2(3.0, 4.0, 1.0).speed() == 5.0
    assert Twist2(3.0, 4.0, 1.0).scaled(0.5) == Twist2(1.5, 2.0, 0.5)


def test_covariance_of_message_puts_x_y_yaw_in_their_places() -> None:
    full = covariance_of_message((1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0))
    assert [full[i] for i in (0, 1, 5, 6, 7, 11, 30, 31, 35)] == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]
    assert [full[i] for i in (14, 21, 28)] == [1e6] * 3
    assert sum(value != 0.0 for value in full) == 12
