"""The current pose from slow poses and fast odometry."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2, wrap_angle
from robot_stack.navigation.pose_source import PoseSource
from tests.unit.navigation.plant import params

AHEAD = Twist2(1.0, 0.0, 0.0)


def source() -> PoseSource:
    return PoseSource(params().pose, max_speed_mps=1.5, max_yaw_rate_radps=1.0)


def driven(map_to_odom: Pose2 = IDENTITY) -> PoseSource:
    """Drives 1 m/s along x of odom from 10.0 s to 11.0 s; the pose of 10.9 s arrives at 11.0 s."""
    poses = source()
    for i in range(51):
        t = 10.0 + 0.02 * i
        poses.on_odometry(t, Pose2(t - 10.0, 0.0, 0.0), AHEAD, received_s=t)
    poses.on_pose(10.9, map_to_odom.compose(Pose2(0.9, 0.0, 0.0)), received_s=11.0)
    return poses


def test_old_pose_is_carried_on_to_now() -> None:
    located, problem = driven(Pose2(5.0, 1.0, math.pi / 2.0)).located(now_s=11.03, steady_s=11.03)
    assert problem == ""
    assert located is not None
    # 1.0 m of odometry and 0.03 s of extrapolation at 1 m/s, along +y of the map.
    assert (located.pose.x, located.pose.y, located.pose.yaw) == pytest.approx((5.0, 2.03, math.pi / 2.0))
    assert located.twist == AHEAD
    late = driven()
    late.on_odometry(10.98, Pose2(0.98, 0.0, 0.0), AHEAD, 11.01)  # ignored
    for now_s, x_m in ((11.0, 1.0), (99.0, 1.0 + 0.1)):  # extrapolation is bounded
        located, _ = late.located(now_s, 11.1)
        assert located is not None
        assert located.pose.x == pytest.approx(x_m)


def test_pose_that_arrives_before_its_odometry() -> None:
    poses = source()
    poses.on_odometry(10.0, IDENTITY, AHEAD, 10.0)
    poses.on_pose(10.02, Pose2(3.0, 0.0, 0.0), 10.02)
    assert poses.located(10.02, 10.02) == (None, "no /current_pose that fits the stamps of /odom")
    poses.on_odometry(10.02, Pose2(0.02, 0.0, 0.0), AHEAD, 10.03)
    located, _ = poses.located(10.02, 10.03)
    assert located is not None
    assert located.pose.x == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("steady_s", "reason"),
    [
        (11.6, "/current_pose silent for more than 0.5 s"),
        (11.3, "/odom silent for more than 0.2 s"),
        (10.5, "/current_pose silent"),
    ],
)
def test_silence_and_time_that_ran_back_are_named(steady_s: float, reason: str) -> None:
    located, problem = driven().located(11.0, steady_s)
    assert located is None
    assert reason in problem
    assert source().located(0.0, 0.0) == (None, "/current_pose never received")


def test_a_pose_repeated_with_an_old_stamp_ages_on() -> None:
    poses = driven()
    for i in range(1, 40):
        t = 11.0 + 0.02 * i
        poses.on_odometry(t, Pose2(t - 10.0, 0.0, 0.0), AHEAD, t)
        poses.on_pose(10.9, Pose2(0.9, 0.0, 0.0), t)
    assert poses.located(11.78, 11.78)[0] is None


@pytest.mark.parametrize("off_s", [-1.3, 3.0])
def test_poses_outside_the_odometry_history_renew_nothing(off_s: float) -> None:
    poses = driven()
    for i in range(1, 36):
        t = 11.0 + 0.02 * i
        poses.on_odometry(t, Pose2(t - 10.0, 0.0, 0.0), AHEAD, t)
        poses.on_pose(t + off_s, Pose2(3.0, 0.0, 0.0), t)
        located, problem = poses.located(t, t)
        assert (located is None) == (t > 11.5)
    assert problem == "no /current_pose that fits the stamps of /odom"


def test_new_odom_frame_waits_for_a_new_pose() -> None:
    poses = driven()
    poses.on_odometry(11.02, Pose2(0.0, 0.0, 0.0), ZERO_TWIST, 11.02)
    assert poses.located(11.02, 11.02)[0] is None
    poses.on_pose(11.02, Pose2(1.02, 0.0, 0.0), 11.03)
    located, _ = poses.located(11.02, 11.03)
    assert located is not None
    assert located.pose.x == pytest.approx(1.02)


@pytest.mark.parametrize("stamp_s", [2.0, 10.8])
def test_clock_set_back_restarts_the_source(stamp_s: float) -> None:
    poses = driven()
    poses.on_odometry(stamp_s, Pose2(1.0, 0.0, 0.0), ZERO_TWIST, 11.02)
    assert poses.located(stamp_s, 11.02)[0] is None
    poses.on_pose(stamp_s, Pose2(1.0, 0.0, 0.0), 11.1)
    assert poses.located(stamp_s, 11.1)[0] is not None


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_not_finite_inputs_are_refused_by_name(bad: float) -> None:
    poses = driven()
    assert "/odom is not finite" in poses.on_odometry(11.02, Pose2(bad, 0.0, 0.0), AHEAD, 11.02)
    assert "/odom is not finite" in poses.on_odometry(11.02, IDENTITY, Twist2(0.0, bad, 0.0), 11.02)
    assert "/current_pose is not finite" in poses.on_pose(11.0, Pose2(0.0, 0.0, bad), 11.02)
    located, _ = poses.located(11.0, 11.02)
    assert located is not None
    assert located.pose.is_finite()


angles = st.floats(-math.pi, math.pi)
frames = st.builds(Pose2, st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), angles)


@given(frames, st.floats(-1.4, 1.4), st.floats(-0.9, 0.9), st.floats(10.0, 11.0))
def test_any_frame_any_motion(map_to_odom: Pose2, speed: float, omega: float, stamp_s: float) -> None:
    poses, pose, twist = source(), IDENTITY, Twist2(speed, 0.3, omega)
    step = 0.02
    from robot_stack.core.geometry import exp_se2

    for i in range(51):
        poses.on_odometry(10.0 + step * i, pose, twist, 11.0)
        pose = pose.compose(exp_se2(twist, step))
    poses.on_pose(stamp_s, map_to_odom.compose(exp_se2(twist, stamp_s - 10.0)), 11.0)
    located, problem = poses.located(11.05, 11.0)
    assert problem == ""
    assert located is not None
    truth = map_to_odom.compose(exp_se2(twist, 1.05))
    # The path between two odometry poses is taken as straight: 20 ms at 1.4 m/s and 0.9 rad/s deviate by 60 um.
    assert located.pose.distance_to(truth) < 2e-4
    assert abs(wrap_angle(located.pose.yaw - truth.yaw)) < 1e-6
