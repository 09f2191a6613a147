"""The localization kernel, as stories in fake time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.core.geometry import IDENTITY, Pose2, Twist2
from robot_stack.localization.gyro import ImuSample
from robot_stack.localization.history import Correction
from robot_stack.localization.localizer import planar_covariance, usable_covariance
from robot_stack.localization.odometry import OdometryEvent
from robot_stack.localization.quality import quality
from tests.unit.localization.stories import params, reading, story

STAND, AHEAD = Twist2(0.0, 0.0, 0.0), Twist2(1.0, 0.0, 0.0)
CURVE = Twist2(0.8, 0.3, 0.4)


def test_estimate_is_empty_before_first_odometry() -> None:
    estimate = story().localizer.estimate(100.0)
    assert estimate.pose is None
    assert estimate.map_to_odom is None
    assert estimate.quality == 0.0
    assert "/odom never received" in estimate.faults


def test_start_pose_comes_from_the_parameters() -> None:
    ride = story(params={"start_x_m": 3.0, "start_y_m": -2.0, "start_yaw_rad": math.pi / 2.0}).drive(AHEAD, 2.0)
    pose = ride.localizer.estimate(ride.t_s).pose
    assert (pose.x, pose.y) == pytest.approx((3.0, -2.0 + ride.truth.x), abs=0.03)


def test_map_to_odom_joins_pose_and_odometry() -> None:
    ride = story(wheel_scale=0.9, params={"start_x_m": 3.0}).drive(STAND, 1.0).drive(CURVE, 4.0)
    estimate = ride.localizer.estimate(ride.t_s)
    assert estimate.pose is not None
    joined = estimate.map_to_odom.compose(ride.wheels)
    assert joined.distance_to(estimate.pose) < 1e-9


def test_bias_is_learnt_standing_and_does_not_turn_the_robot() -> None:
    ride = story(bias_radps=0.01, noise_radps=0.003).drive(STAND, 5.0)
    assert ride.localizer.estimate(ride.t_s).gyro_bias_radps == pytest.approx(0.01, abs=0.0005)
    ride.drive(AHEAD, 20.0)
    assert ride.yaw_error_rad() < 0.01  # without learning it would be 0.2
    assert ride.localizer.estimate(ride.t_s).standing is False


def test_standing_still_adds_no_uncertainty() -> None:
    ride = story(noise_radps=0.003, twist_variance=(1e-4, 1e-4, 1e-4)).drive(STAND, 2.0)
    before = ride.localizer.estimate(ride.t_s)
    ride.drive(STAND, 60.0)
    after = ride.localizer.estimate(ride.t_s)
    assert after.position_sigma_m == pytest.approx(before.position_sigma_m, rel=1e-3)
    assert after.yaw_sigma_rad == pytest.approx(before.yaw_sigma_rad, rel=1e-2)


def test_wheels_that_scrub_in_turns_are_outweighed_by_the_gyro() -> None:
    ride = story(wheel_scale=0.95, noise_radps=0.003).drive(STAND, 3.0).drive(Twist2(0.5, 0.0, 0.5), 12.0)
    assert ride.yaw_error_rad() < 0.02  # with the wheels alone the error would be 0.3


def test_twist_covariance_raises_pose_uncertainty() -> None:
    ride = story().drive(AHEAD, 5.0)
    sure = ride.localizer.estimate(ride.t_s)
    ride = story(twist_variance=(0.5, 0.5, 0.5)).drive(AHEAD, 5.0)
    slipping = ride.localizer.estimate(ride.t_s)
    assert slipping.position_sigma_m > 2.0 * sure.position_sigma_m
    assert slipping.quality < sure.quality


def test_silent_imu_lowers_quality_and_wheels_go_on() -> None:
    ride = story(noise_radps=0.003).drive(STAND, 2.0).drive(AHEAD, 2.0)
    before = ride.localizer.estimate(ride.t_s)
    ride.imu_on = False
    ride.drive(AHEAD, 2.0)
    after = ride.localizer.estimate(ride.t_s)
    assert before.gyro_used
    assert not after.gyro_used
    assert 0.5 < after.quality < before.quality
    assert "/sensors/imu missing: yaw from the wheels alone" in after.faults
    assert ride.error_m() < 0.02
    ride.imu_on = True
    ride.drive(AHEAD, 0.2)
    assert ride.localizer.estimate(ride.t_s).gyro_used


@pytest.mark.parametrize(("rate", "word"), [(0.3, "frozen"), (math.nan, "not finite")])
def test_imu_that_is_frozen_or_not_finite_is_named_and_left_out(rate: float, word: str) -> None:
    ride = story().drive(AHEAD, 1.0)
    ride.imu_on = False
    for i in range(100):
        ride.localizer.on_imu(ImuSample(ride.t_s + 0.01, rate, (rate, 0.0)))
        ride.drive(AHEAD, 0.01)
        if i == 50:
            turned = ride.yaw_error_rad()
    estimate = ride.localizer.estimate(ride.t_s)
    assert not estimate.gyro_used
    assert any(word in fault for fault in estimate.faults)
    assert ride.yaw_error_rad() == pytest.approx(turned)  # no further turn is taken from the gyro
    assert turned < 0.05


def test_silent_odometry_fades_the_quality_then_silences_the_pose() -> None:
    ride = story().drive(AHEAD, 2.0)
    ride.odometry_on = False
    qualities = []
    for _ in range(6):
        qualities.append(ride.localizer.estimate(ride.t_s).quality)
        ride.drive(AHEAD, 0.1)
    assert qualities == sorted(qualities, reverse=True)
    assert qualities[0] > 0.9
    assert qualities[3] < 0.6
    estimate = ride.localizer.estimate(ride.t_s)
    assert estimate.pose is None
    assert estimate.quality == 0.0
    assert "/odom silent" in estimate.faults
    ride.odometry_on = True  # the wheels kept counting meanwhile
    ride.drive(AHEAD, 0.1)
    assert ride.localizer.estimate(ride.t_s).pose is not None
    assert ride.error_m() < 0.001


def test_restarted_odometry_holds_the_pose() -> None:
    ride = story().drive(AHEAD, 3.0)
    before = ride.localizer.estimate(ride.t_s)
    ride.wheels = IDENTITY
    event = ride.localizer.on_odometry(reading(ride.t_s + 0.01, IDENTITY), ride.t_s)
    after = ride.localizer.estimate(ride.t_s)
    assert event is OdometryEvent.RESTARTED
    assert after.pose == before.pose
    assert after.position_sigma_m > before.position_sigma_m
    assert after.map_to_odom == after.pose  # odom starts at the robot's pose
    assert any("restarted" in fault for fault in after.faults)


@pytest.mark.parametrize("now_s", [5.0, 3703.0], ids=["back", "forward"])
def test_clock_that_is_set_keeps_the_pose(now_s: float) -> None:
    ride = story().drive(AHEAD, 3.0)
    ride.t_s = now_s
    ride.drive(AHEAD, 2.0)
    estimate = ride.localizer.estimate(ride.t_s)
    assert estimate.pose is not None
    assert ride.error_m() < 0.05
    assert estimate.gyro_used
    assert estimate.stamp_s == pytest.approx(now_s + 2.0)


def test_correction_by_a_measured_pose() -> None:
    ride = story(params={"start_x_m": 0.1}).drive(AHEAD, 3.0)
    assert ride.error_m() == pytest.approx(0.1, abs=0.01)
    seen, then_s = ride.truth, ride.t_s
    ride.drive(AHEAD, 0.16)
    verdict = ride.localizer.correct(seen, np.diag([1e-6, 1e-6, 1e-6]), then_s)
    assert verdict is Correction.APPLIED
    assert ride.error_m() < 0.003


def test_correction_that_is_not_finite_is_refused() -> None:
    ride = story().drive(AHEAD, 1.0)
    assert ride.localizer.correct(Pose2(math.nan, 0.0, 0.0), np.eye(3), ride.t_s) is Correction.NOT_FINITE
    assert ride.localizer.correct(IDENTITY, np.full((3, 3), math.nan), ride.t_s) is Correction.NOT_FINITE
    assert ride.error_m() < 0.001


def test_given_pose_replaces_the_estimate_and_keeps_the_bias() -> None:
    ride = story(bias_radps=0.01).drive(STAND, 3.0)
    bias = ride.localizer.estimate(ride.t_s).gyro_bias_radps
    ride.localizer.reset(Pose2(50.0, -7.0, 3.0), np.diag([0.25, 0.25, 0.01]), ride.t_s)
    estimate = ride.localizer.estimate(ride.t_s)
    assert (estimate.pose.x, estimate.pose.y, estimate.pose.yaw) == pytest.approx((50.0, -7.0, 3.0))
    assert estimate.position_sigma_m == pytest.approx(0.5)
    assert estimate.gyro_bias_radps == bias


def test_given_pose_of_a_moment_ago_gets_the_motion_since() -> None:
    ride = story().drive(AHEAD, 3.0)
    then_s = ride.t_s
    ride.drive(AHEAD, 0.5)
    ride.localizer.reset(Pose2(10.0, 0.0, 0.0), np.eye(3) * 0.01, then_s)
    pose = ride.localizer.estimate(ride.t_s).pose
    assert pose.x == pytest.approx(10.5, abs=1e-3)


def test_unusable_given_pose_is_refused() -> None:
    localizer = story().localizer
    with pytest.raises(ValueError, match="pose is not finite"):
        localizer.reset(Pose2(math.nan, 0.0, 0.0), np.eye(3), 0.0)
    with pytest.raises(ValueError, match="covariance"):
        localizer.reset(IDENTITY, np.zeros((3, 3)), 0.0)


@pytest.mark.parametrize(
    ("covariance", "usable"),
    [
        (np.eye(3), True),
        (np.zeros((3, 3)), False),
        (np.diag([1.0, -1.0, 1.0]), False),
        (np.diag([1.0, math.inf, 1.0]), False),
        (np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), False),
        (np.eye(2), False),
    ],
)
def test_usable_covariance(covariance: np.ndarray, usable: bool) -> None:
    assert usable_covariance(covariance) is usable


def test_planar_part_of_a_ros_covariance() -> None:
    full = np.arange(36.0)
    assert planar_covariance(full).tolist() == [[0.0, 1.0, 5.0], [6.0, 7.0, 11.0], [30.0, 31.0, 35.0]]


def test_quality_scale() -> None:
    scale = params().quality
    assert quality(0.0, 0.0, 0.0, True, scale) == 1.0
    assert quality(0.5, 0.0, 0.0, True, scale) == pytest.approx(0.5)
    assert quality(0.0, 0.17, 0.0, True, scale) == pytest.approx(0.5)
    assert quality(0.5, 0.17, 0.0, True, scale) == pytest.approx(0.5)
    assert quality(0.0, 0.0, 0.0, False, scale) == pytest.approx(0.7)
    assert quality(0.0, 0.0, 0.3, True, scale) == pytest.approx(0.5)  # halfway between 0.1 and 0.5 s
    assert quality(0.0, 0.0, 9.0, True, scale) == 0.0
    assert quality(math.nan, 0.0, 0.0, True, scale) == 0.0


speeds = st.builds(Twist2, st.floats(-1.5, 1.5), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
actions = st.sampled_from(
    ["drive", "imu off", "imu on", "imu nan", "odom off", "odom on", "odom reset", "odom nan", "back"]
)


@given(st.lists(st.tuples(actions, speeds), max_size=12))
@settings(max_examples=25, deadline=None)
def test_whatever_happens_the_answer_is_finite_or_absent(steps: list[tuple[str, Twist2]]) -> None:
    ride = story(noise_radps=0.003, bias_radps=0.005)
    for action, twist in steps:
        if action.startswith("imu o"):
            ride.imu_on = action == "imu on"
        elif action.startswith("odom o"):
            ride.odometry_on = action == "odom on"
        elif action == "imu nan":
            ride.localizer.on_imu(ImuSample(ride.t_s + 0.005, math.nan, (math.nan,)))
        elif action == "odom nan":
            ride.localizer.on_odometry(reading(ride.t_s + 0.005, Pose2(math.nan, 0.0, 0.0)), ride.t_s)
        elif action == "odom reset":
            ride.wheels = IDENTITY
        elif action == "back":
            ride.t_s -= 40.0
        ride.drive(twist, 0.3)
        estimate = ride.localizer.estimate(ride.t_s)
        assert 0.0 <= estimate.quality <= 1.0
        if estimate.pose is not None:
            assert estimate.pose.is_finite()
            assert math.isfinite(estimate.stamp_s)
            assert math.isfinite(estimate.position_sigma_m)
            assert math.isfinite(estimate.yaw_sigma_rad)
