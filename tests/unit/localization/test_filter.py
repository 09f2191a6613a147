"""The Kalman filter and its history of one second."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.localization.filter import PoseFilter, Step
from robot_stack.localization.gyro import GyroIncrement
from robot_stack.localization.history import Correction, DelayedFilter

TIGHT = np.diag([1e-6, 1e-6, 1e-6])


def pose_filter(start: Pose2 = IDENTITY, covariance: np.ndarray = TIGHT, bias_sigma: float = 0.02) -> PoseFilter:
    return PoseFilter(start, covariance, bias_sigma, 0.0, disagreement_sigmas=6.0)


def step(stamp_s: float = 0.0, motion: Pose2 = IDENTITY, yaw_variance: float = 1e-6, **changes: object) -> Step:
    values = {"dt_s": 0.02, "variance": (1e-8, 1e-8, yaw_variance), "gyro": None, **changes}
    return Step(stamp_s, motion=motion, **values)  # type: ignore[arg-type]


def test_motion_is_composed_in_the_body_frame() -> None:
    kalman = pose_filter(Pose2(1.0, 2.0, math.pi / 2.0))
    kalman.predict(step(motion=Pose2(0.3, 0.1, 0.2)))
    pose = kalman.state().pose
    assert (pose.x, pose.y, pose.yaw) == pytest.approx((0.9, 2.3, math.pi / 2.0 + 0.2))


def test_wheels_and_gyro_share_by_their_variances() -> None:
    kalman = pose_filter(bias_sigma=0.0)
    # The wheels measure 0.10 with variance 3e-4, the gyro 0.14 with 1e-4: (1 * 0.10 + 3 * 0.14) / 4 = 0.13.
    kalman.predict(step(motion=Pose2(0.0, 0.0, 0.10), yaw_variance=3e-4, gyro=GyroIncrement(0.14, 1e-4)))
    state = kalman.state()
    assert state.pose.yaw == pytest.approx(0.13)
    assert state.yaw_sigma_rad**2 == pytest.approx(1e-6 + 0.75e-4)


def test_filter_follows_gyro_when_wheels_slip() -> None:
    kalman = pose_filter(bias_sigma=0.0)
    slipped = kalman.predict(step(motion=Pose2(0.0, 0.0, 0.1), yaw_variance=1e-8, gyro=GyroIncrement(0.0, 1e-8)))
    assert slipped
    assert kalman.state().pose.yaw == pytest.approx(0.0, abs=1e-6)


def test_heading_error_turns_into_sideways_error() -> None:
    kalman = pose_filter(covariance=np.diag([0.0, 0.0, 0.01**2]))
    kalman.predict(step(motion=Pose2(10.0, 0.0, 0.0)))
    covariance = kalman.state().pose_covariance
    assert math.sqrt(covariance[1, 1]) == pytest.approx(0.1, rel=1e-3)  # 10 m * 0.01 rad
    assert covariance[1, 2] == pytest.approx(1e-3, rel=1e-3)


def test_standing_teaches_the_bias() -> None:
    kalman = pose_filter()
    for _ in range(100):
        kalman.predict(step(variance=(0.0, 0.0, 0.0), gyro=GyroIncrement(0.015 * 0.02, 1e-9), standing=True))
    state = kalman.state()
    assert state.bias_radps == pytest.approx(0.015, rel=0.02)
    assert state.bias_sigma_radps < 0.001
    assert abs(state.pose.yaw) < 1e-5


def test_correction_across_the_cut_of_the_circle() -> None:
    kalman = pose_filter(Pose2(0.0, 0.0, math.pi - 0.01), np.diag([1.0, 1.0, 1e-4]))
    assert kalman.correct(Pose2(1.0, 0.0, -math.pi + 0.01), np.diag([1.0, 1.0, 1e-4]), gate_sigmas=5.0)
    pose = kalman.state().pose
    assert pose.x == pytest.approx(0.5)
    assert abs(pose.yaw) == pytest.approx(math.pi, abs=1e-9)


def test_outlier_is_refused() -> None:
    kalman = pose_filter(covariance=np.diag([0.01, 0.01, 0.01]))
    before = kalman.state()
    assert not kalman.correct(Pose2(2.0, 0.0, 0.0), np.diag([0.01, 0.01, 0.01]), gate_sigmas=5.0)
    assert kalman.state().pose == before.pose


turns = st.floats(-0.05, 0.05)
moves = st.builds(Pose2, st.floats(-0.03, 0.03), st.floats(-0.03, 0.03), turns)


@given(st.lists(st.tuples(moves, st.none() | turns), min_size=3, max_size=20), st.data())
@settings(max_examples=60)
def test_a_late_correction_equals_a_timely_one(inputs: list[tuple[Pose2, float | None]], data: st.DataObject) -> None:
    steps = [
        step(0.02 * (i + 1), motion, gyro=None if turn is None else GyroIncrement(turn, 1e-8))
        for i, (motion, turn) in enumerate(inputs)
    ]
    at = data.draw(st.integers(1, len(steps) - 1))
    wide, measured = np.diag([0.04, 0.04, 0.01]), np.diag([0.01, 0.01, 0.01])
    late, timely = (DelayedFilter(pose_filter(covariance=wide), 1.0) for _ in range(2))
    late.start(0.0)
    timely.start(0.0)
    for item in steps[:at]:
        late.predict(item)
        timely.predict(item)
    pose = late.state().pose.compose(Pose2(0.1, -0.1, 0.05))
    assert timely.correct(pose, measured, 0.02 * at, 5.0) is Correction.APPLIED
    for item in steps[at:]:
        late.predict(item)
        timely.predict(item)
    assert late.correct(pose, measured, 0.02 * at, 5.0) is Correction.APPLIED
    np.testing.assert_allclose(late.state().mean, timely.state().mean, atol=1e-9)
    np.testing.assert_allclose(late.state().covariance, timely.state().covariance, atol=1e-9)


def history(steps: int = 100, history_s: float = 1.0) -> DelayedFilter:
    kalman = DelayedFilter(pose_filter(covariance=np.diag([0.04, 0.04, 0.01])), history_s)
    kalman.start(0.0)
    for i in range(steps):
        kalman.predict(step(0.02 * (i + 1), Pose2(0.02, 0.0, 0.0)))
    return kalman


def test_correction_between_two_steps() -> None:
    kalman = history()  # 1 m/s for 2 s
    true_then = Pose2(1.51 + 0.3, 0.0, 0.0)
    assert kalman.correct(true_then, np.diag([1e-9, 1e-9, 1e-9]), 1.51, 5.0) is Correction.APPLIED
    assert kalman.state().pose.x == pytest.approx(2.3, abs=1e-3)
    assert kalman.stamp_s == pytest.approx(2.0)


def test_corrections_outside_the_history_are_refused() -> None:
    kalman = history()
    assert kalman.correct(IDENTITY, np.eye(3), 0.9, 5.0) is Correction.TOO_OLD
    assert kalman.correct(IDENTITY, np.eye(3), 2.01, 5.0) is Correction.TOO_NEW
    assert kalman.pose_at(0.5) is None
    assert kalman.pose_at(2.1) is None
    assert kalman.correct(Pose2(1.8, 0.0, 0.0), np.eye(3), 1.8, 5.0) is Correction.APPLIED
    assert kalman.correct(Pose2(1.6, 0.0, 0.0), np.eye(3), 1.6, 5.0) is Correction.TOO_OLD, "older than the last"


def test_rejected_outlier_leaves_history_unchanged() -> None:
    kalman = history()
    before = kalman.state()
    assert kalman.correct(Pose2(9.0, 0.0, 0.0), np.eye(3) * 1e-4, 1.51, 5.0) is Correction.OUTLIER
    np.testing.assert_array_equal(kalman.state().mean, before.mean)
    assert kalman.pose_at(1.5).x == pytest.approx(1.5)  # type: ignore[union-attr]
    assert kalman.pose_at(1.51).x == pytest.approx(1.51)  # type: ignore[union-attr]


def test_a_step_that_is_not_finite_is_dropped() -> None:
    kalman = history()
    before = kalman.state()
    kalman.predict(step(2.02, Pose2(math.nan, 0.0, 0.0)))
    np.testing.assert_array_equal(kalman.state().mean, before.mean)
    assert kalman.stamp_s == pytest.approx(2.0)
