"""Increments of wheel odometry."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.geometry import IDENTITY, Pose2, Twist2
from robot_stack.localization.odometry import OdometryEvent, OdometryIncrements
from tests.unit.localization.stories import params, reading


def increments() -> OdometryIncrements:
    return OdometryIncrements(params().odometry, max_speed_mps=1.5, max_yaw_rate_radps=1.0)


def test_first_reading_moves_nothing() -> None:
    first = increments().take(reading(10.0, Pose2(5.0, 5.0, 1.0)))
    assert first.event is OdometryEvent.FIRST
    assert first.motion == IDENTITY


def test_increment_is_in_the_frame_of_the_earlier_pose() -> None:
    odometry = increments()
    odometry.take(reading(10.0, Pose2(1.0, 2.0, math.pi / 2.0)))
    # The robot faces +y of odom and moves 0.01 m along +y: forward in its own frame.
    step = odometry.take(reading(10.02, Pose2(1.0, 2.01, math.pi / 2.0)))
    assert step.event is OdometryEvent.MOTION
    assert (step.motion.x, step.motion.y, step.motion.yaw) == pytest.approx((0.01, 0.0, 0.0), abs=1e-12)


def test_variance_grows_with_the_way_and_with_the_message() -> None:
    odometry = increments()
    odometry.take(reading(10.0, twist_variance=(0.0, 0.0, 0.0)))
    step = odometry.take(reading(10.5, Pose2(0.5, 0.0, 0.1), twist_variance=(0.04, 0.09, 0.01)))
    # position: 0.02^2 m2/m * 0.5 m = 2e-4, plus 0.04 (m/s)2 * (0.5 s)^2 = 0.01 along x and 0.09 * 0.25 across.
    # yaw: 0.003^2 * 0.5 + 0.01^2 * 0.1 = 1.45e-5, plus 0.01 * 0.25.
    assert step.variance == pytest.approx((0.0102, 0.0227, 0.0025145))
    odometry = increments()
    odometry.take(reading(10.0))
    step = odometry.take(reading(13.0, Pose2(3.0, 0.0, 0.0), Twist2(1.0, 0.0, 0.0), twist_variance=(-1.0, -1.0, -1.0)))
    assert step.event is OdometryEvent.MOTION, "lost messages lose no motion"
    assert step.motion.x == pytest.approx(3.0)
    assert step.variance[0] == pytest.approx(0.02**2 * 3.0, rel=1e-3), "an unknown covariance adds nothing"


def test_jump_of_odometry_covariance_is_added_to_step_variance() -> None:
    odometry = increments()
    odometry.take(reading(10.0, pose_variance=(0.1, 0.1, 0.01), twist_variance=(0.0, 0.0, 0.0)))
    step = odometry.take(reading(10.02, pose_variance=(6.1, 5.1, 9.01), twist_variance=(0.0, 0.0, 0.0)))
    assert step.event is OdometryEvent.MOTION
    assert step.variance == pytest.approx((6.0, 5.0, 9.0))


def test_covariance_growth_caused_by_yaw_adds_no_step_variance() -> None:
    odometry = increments()
    odometry.take(reading(10.0, pose_variance=(1.0, 1.0, 0.01), twist_variance=(0.0, 0.0, 0.0)))
    step = odometry.take(reading(10.02, pose_variance=(1.2, 1.2, 0.0101), twist_variance=(0.0, 0.0, 0.0)))
    assert step.variance == (0.0, 0.0, 0.0)


def test_odometry_restart_yields_no_motion() -> None:
    odometry = increments()
    odometry.take(reading(10.0, Pose2(8.0, 3.0, 2.0), Twist2(1.0, 0.0, 0.0)))
    step = odometry.take(reading(10.02, IDENTITY))
    assert step.event is OdometryEvent.RESTARTED
    assert step.motion == IDENTITY
    # 1 m/s for 20 ms and the tolerance of 0.05 m: 0.07 m.
    assert step.variance[0] == pytest.approx(0.07**2)


def test_small_restart_shows_in_the_shrunken_covariance() -> None:
    odometry = increments()
    odometry.take(reading(10.0, Pose2(0.02, 0.0, 0.0), pose_variance=(1e-3, 1e-3, 1e-3)))
    step = odometry.take(reading(10.02, IDENTITY, pose_variance=(1e-6, 1e-6, 1e-6)))
    assert step.event is OdometryEvent.RESTARTED


def test_late_reading_changes_nothing() -> None:
    odometry = increments()
    odometry.take(reading(10.0))
    odometry.take(reading(10.04, Pose2(0.04, 0.0, 0.0)))
    assert odometry.take(reading(10.02, Pose2(0.02, 0.0, 0.0))).event is OdometryEvent.LATE
    assert odometry.take(reading(10.06, Pose2(0.06, 0.0, 0.0))).motion.x == pytest.approx(0.02)


@pytest.mark.parametrize("stamp_s", [3.0, 999.8])
def test_clock_set_back_restarts_odometry_increments(stamp_s: float) -> None:
    odometry = increments()
    odometry.take(reading(1000.0, Pose2(4.0, 0.0, 0.0)))
    assert odometry.take(reading(stamp_s, IDENTITY)).event is OdometryEvent.CLOCK_RESTARTED
    assert odometry.take(reading(stamp_s + 0.02, Pose2(0.01, 0.0, 0.0))).event is OdometryEvent.MOTION


@pytest.mark.parametrize("bad", [math.nan, -math.inf])
@pytest.mark.parametrize("field", ["stamp", "pose", "twist", "twist_variance", "pose_variance"])
def test_not_finite_reading_is_named_and_ignored(field: str, bad: float) -> None:
    odometry = increments()
    odometry.take(reading(10.0))
    broken = {
        "stamp": lambda: reading(bad),
        "pose": lambda: reading(10.02, Pose2(0.0, bad, 0.0)),
        "twist": lambda: reading(10.02, IDENTITY, Twist2(0.0, 0.0, bad)),
        "twist_variance": lambda: reading(10.02, twist_variance=(bad, 0.0, 0.0)),
        "pose_variance": lambda: reading(10.02, pose_variance=(0.0, bad, 0.0)),
    }[field]()
    assert field.split("_")[0] in broken.problem()
    assert odometry.take(broken).event is OdometryEvent.UNUSABLE
    assert odometry.take(reading(10.04, Pose2(0.01, 0.0, 0.0))).motion.x == pytest.approx(0.01)
