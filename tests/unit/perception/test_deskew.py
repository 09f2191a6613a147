"""De-skew: moves every point to the stamp of the sweep."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.core.config import load
from robot_stack.core.geometry import Pose2, Twist2, exp_se2
from robot_stack.core.point_cloud import SWEEP
from robot_stack.core.robot import Robot
from robot_stack.perception.attitude import attitude_of
from robot_stack.perception.deskew import Attitude, Motion, deskew
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline
from tests.unit.perception.scenes import sweep

DESKEW = load(PerceptionParams, "perception_pipeline").deskew
TWISTS = st.builds(Twist2, st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.floats(-1.0, 1.0))


def driven(twist: Twist2, until_s: float = 0.0) -> Motion:
    """Feeds odometry at 50 Hz with a constant twist from -0.5 s on."""
    motion = Motion(DESKEW)
    for step in range(1000):
        stamp_s = -0.5 + 0.02 * step
        if stamp_s > until_s + 1e-9:
            break
        motion.on_odometry(stamp_s, exp_se2(twist, stamp_s), twist)
    return motion


def test_wall_ahead_approaches_by_the_driven_distance() -> None:
    """1 m/s for 0.05 s: a point measured 5.00 m ahead is now 4.95 m ahead."""
    motion = driven(Twist2(1.0, 0.0, 0.0))
    xyz = np.array([[5.0, 0.0, 0.5], [4.95, 0.0, 0.5]], np.float32)
    moved = deskew(xyz, np.array([-0.05, 0.0], np.float32), motion.steps(0.0, -0.05), DESKEW.step_s)
    np.testing.assert_allclose(moved, [[4.95, 0.0, 0.5], [4.95, 0.0, 0.5]], atol=1e-5)


@settings(max_examples=40, deadline=None)
@given(TWISTS, st.floats(-0.1, 0.0), st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), st.floats(0.0, 0.02))
def test_a_fixed_point_stays_where_it_is(
    twist: Twist2, time_s: float, x: float, y: float, odometry_late_s: float
) -> None:
    motion = driven(twist, until_s=-odometry_late_s)
    there = exp_se2(twist, time_s).inverse().compose(Pose2(x, y, 0.0))
    steps = motion.steps(0.0, -0.1)
    moved = deskew(
        np.array([[there.x, there.y, 0.3]], np.float32), np.array([time_s], np.float32), steps, DESKEW.step_s
    )
    np.testing.assert_allclose(moved[0], [x, y, 0.3], atol=2e-3)


def test_pitching_over_an_edge_is_taken_out() -> None:
    """Nose up by 2 deg in 0.1 s: level ground 10 m ahead appears 0.35 m lower in base_link."""
    motion = driven(Twist2(0.0, 0.0, 0.0))
    for step in range(31):
        stamp_s = -0.3 + 0.01 * step
        motion.on_attitude(stamp_s, Attitude(0.0, math.radians(-20.0 * (stamp_s + 0.1))))
    before = np.array([[10.0, 0.0, 0.0]])
    moved = deskew(before.astype(np.float32), np.array([-0.1], np.float32), motion.steps(0.0, -0.1), DESKEW.step_s)
    assert moved[0, 2] == pytest.approx(-10.0 * math.sin(math.radians(2.0)), abs=0.01)


def test_odometry_that_stops_is_named() -> None:
    assert Motion(DESKEW).problem(0.0) == "no /odom yet"
    motion = driven(Twist2(0.5, 0.0, 0.0), until_s=-0.1)
    assert motion.problem(0.0) == ""
    assert "0.25 s older than the sweep, limit 0.2 s" in motion.problem(0.15)


def test_clock_set_back_clears_the_stored_observations(
    pipeline: Pipeline, robot: Robot, params: PerceptionParams
) -> None:
    new = Pipeline(robot, params)
    new.scene(np.empty(0, SWEEP), 9.6)
    pipeline.motion.on_odometry(10.0, Pose2(0.0, 0.0, 0.0), Twist2(0.0, 0.0, 0.0))
    pipeline.scene(sweep(), 10.0)
    pipeline.motion.on_odometry(9.6, Pose2(0.0, 0.0, 0.0), Twist2(0.0, 0.0, 0.0))
    pipeline.scene(np.empty(0, SWEEP), 9.6)
    np.testing.assert_array_equal(pipeline.grid().state, new.grid().state)


@pytest.mark.parametrize("back_s", [0.13, 0.4, 2.0])
def test_clock_set_back_keeps_the_present_pose(back_s: float) -> None:
    motion = driven(Twist2(1.0, 0.0, 0.0))
    motion.on_attitude(0.0, Attitude(0.0, 0.0))
    motion.on_odometry(0.02 - back_s, Pose2(0.02, 0.0, 0.0), Twist2(1.0, 0.0, 0.0))
    motion.on_attitude(0.02 - back_s, Attitude(0.1, 0.0))
    assert motion.pose_at(0.03 - back_s).x == pytest.approx(0.03)
    assert motion.attitude_at(0.03 - back_s) == Attitude(0.1, 0.0)
    assert motion.restarts == 1


def test_late_reading_is_ignored() -> None:
    motion = driven(Twist2(1.0, 0.0, 0.0))
    motion.on_odometry(-0.09, Pose2(7.0, 0.0, 0.0), Twist2(1.0, 0.0, 0.0))
    motion.on_odometry(-0.09, Pose2(7.0, 0.0, 0.0), Twist2(1.0, 0.0, 0.0))
    assert motion.pose_at(-0.09).x == pytest.approx(-0.09)
    assert motion.restarts == 0


def test_readings_that_are_not_finite_are_refused() -> None:
    motion = Motion(DESKEW)
    assert motion.on_odometry(0.0, Pose2(math.nan, 0.0, 0.0), Twist2(0.0, 0.0, 0.0)) == "/odom is not finite"
    motion.on_attitude(0.0, Attitude(math.nan, 0.0))
    assert motion.attitude_at(0.0) is None


def test_stale_attitude_is_not_used() -> None:
    motion = Motion(DESKEW)
    motion.on_attitude(0.0, Attitude(0.1, 0.2))
    assert motion.attitude_at(0.05) == Attitude(0.1, 0.2)
    assert motion.attitude_at(0.2) is None


@pytest.mark.parametrize(("roll", "pitch"), [(0.1, -0.17), (-0.2, 0.3)])
def test_roll_and_pitch_of_a_quaternion(roll: float, pitch: float) -> None:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_euler("ZYX", [1.2, pitch, roll]).as_quat()
    attitude = attitude_of(x, y, z, w)
    assert (attitude.roll_rad, attitude.pitch_rad) == pytest.approx((roll, pitch))
    matrix = Rotation.from_euler("ZYX", [0.0, pitch, roll]).as_matrix()
    np.testing.assert_allclose(attitude.matrix(), matrix, atol=1e-12)
    tilted = Attitude.of_tilt((float(matrix[2, 0]), float(matrix[2, 1])))
    assert (tilted.roll_rad, tilted.pitch_rad) == pytest.approx((roll, pitch))


def test_no_orientation_is_no_attitude() -> None:
    assert attitude_of(0.0, 0.0, 0.0, 0.0) is None
    assert attitude_of(math.nan, 0.0, 0.0, 1.0) is None
