"""Poses of the last seconds, looked up by stamp."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.geometry import Pose2
from robot_stack.core.pose_history import PoseHistory


def history() -> PoseHistory:
    history = PoseHistory(1.0)
    history.add(10.0, Pose2(0.0, 0.0, 3.0))
    history.add(10.1, Pose2(0.2, 0.0, -3.0))
    return history


def test_between_two_poses_it_steps_straight_and_turns_the_short_way() -> None:
    pose = history().at(10.05)
    assert pose is not None
    assert abs(pose.yaw) == pytest.approx(math.pi, abs=1e-9)  # halfway from 3.0 over pi to -3.0
    assert (pose.x, pose.y) == pytest.approx((0.1, 0.0), abs=2e-3)


@pytest.mark.parametrize("stamp_s", [9.99, 10.11, math.nan, math.inf])
def test_outside_the_history_nothing_is_known(stamp_s: float) -> None:
    assert history().at(stamp_s) is None
    assert PoseHistory(1.0).at(stamp_s) is None


def test_the_newest_pose_is_found_at_its_own_stamp() -> None:
    assert history().at(10.1) == Pose2(0.2, 0.0, -3.0)


def test_a_pose_that_comes_late_is_not_taken() -> None:
    late = history()
    assert not late.add(10.05, Pose2(5.0, 5.0, 0.0))
    assert not late.add(10.1, Pose2(5.0, 5.0, 0.0))
    assert late.newest is not None
    assert late.newest.pose == Pose2(0.2, 0.0, -3.0)


def test_poses_older_than_history_are_dropped() -> None:
    long = history()
    long.add(11.05, Pose2(1.0, 0.0, 0.0))
    assert long.at(10.0) is None
    assert long.at(10.1) is not None
    long.clear()
    assert long.newest is None
