"""Sightings and their odometry, in either order of arrival."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.camera import mounting
from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import load_robot
from robot_stack.docking.dock_calibration import Correction
from robot_stack.docking.dock_tracker import DockTracker
from tests.unit.docking.bench import dock, markers_at, params

DOCK = dock("chair_1")
AHEAD = Pose2(1.5, 0.0, 0.0)


@pytest.fixture
def tracker() -> DockTracker:
    made = DockTracker(params().target, {DOCK.camera_frame: mounting(load_robot(), DOCK.camera_frame)})
    made.look_for(DOCK, Correction())
    made.on_odometry(0.98, Pose2(0.0, 0.0, 0.0))
    return made


def test_the_newest_sighting_ahead_of_the_odometry_wins(tracker: DockTracker) -> None:
    tracker.on_markers(markers_at(AHEAD, DOCK, 0.99))
    tracker.on_markers(markers_at(AHEAD, DOCK, 0.995))
    assert tracker.estimate is None
    tracker.on_odometry(1.00, Pose2(0.0, 0.0, 0.0))
    assert tracker.seen_s == 0.995
    assert tracker.estimate is not None
    assert tracker.estimate.pose.distance_to(AHEAD) < 0.01


@pytest.mark.parametrize("why", ["before all odometry", "another job"])
def test_sightings_that_are_dropped(tracker: DockTracker, why: str) -> None:
    tracker.on_markers(markers_at(AHEAD, DOCK, 0.5 if why == "before all odometry" else 0.99))
    if why == "another job":
        tracker.look_for(DOCK, Correction())
    tracker.on_odometry(1.00, Pose2(0.0, 0.0, 0.0))
    assert tracker.estimate is None


def test_a_clock_that_is_set_back_hides_no_sighting_and_no_lack_of_them(tracker: DockTracker) -> None:
    tracker.on_markers(markers_at(AHEAD, DOCK, 0.98))
    tracker.on_odometry(-3600.0, Pose2(0.0, 0.0, 0.0))
    assert tracker.seen_s == -3600.0, "its age restarts at zero"
    assert tracker.board(-3600.0, 0.5) is None
    assert tracker.dock_pose_in_odom() is not None, "a search beside the dock backs off first"
    tracker.count_from(-3600.0)
    tracker.on_markers(markers_at(AHEAD, DOCK, -3600.0))
    assert len(tracker.sightings) == 1
    assert tracker.board(-3600.0, 0.5) is not None


def test_a_clock_that_is_set_back_before_the_first_sighting_shows_none(tracker: DockTracker) -> None:
    tracker.count_from(0.0)
    tracker.on_odometry(-3600.0, Pose2(0.0, 0.0, 0.0))
    assert tracker.seen_s == -math.inf
    tracker.on_markers(markers_at(AHEAD, DOCK, -3600.0))
    assert len(tracker.sightings) == 1
