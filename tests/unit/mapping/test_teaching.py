"""The display during a teaching ride: the same odometry as the build's, and correct warnings."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from robot_stack.core.robot import load_robot
from robot_stack.mapping.collector import Collector
from robot_stack.mapping.course import begun_at
from robot_stack.mapping.lidar_odometry import lidar_odometry
from robot_stack.mapping.ride import driven
from robot_stack.mapping.teaching import GrowingMap, Inputs, Motion, status_line, warnings_of
from tests.unit.mapping import site

WELL = Inputs(sweeps=50, without_odometry=0, points_age_s=0.1, odometry_age_s=0.02, imu_age_s=0.01, lost=0)


def taught(collector: Collector, together: int = 1) -> GrowingMap:
    """Feeds the ride of ``site`` as it arrives. together: number of odometry readings between two updates."""
    growing, seen, count = GrowingMap(site.params(), site.START), 0, -1
    for time_s, points, pose in site.in_order(site.recorded()):
        if pose is None:
            collector.sweep(time_s, points)
            continue
        count += 1
        # The IMU measures a changing slope, which the path of the wheels follows.
        collector.imu(time_s, 0.02 * math.sin(time_s), 0.05 * math.sin(0.3 * time_s), 0.0)
        collector.odometry(time_s, pose.x, pose.y, pose.yaw)
        fresh = collector.kept - seen
        if fresh and count % together == 0:
            growing.add(collector.newest(fresh + 1), fresh)
            seen = collector.kept
    return growing


@pytest.fixture(scope="module")
def ridden():
    collector = Collector(site.params().sweeps, load_robot())
    return taught(collector), collector.finish()


def test_teaching_display_uses_same_odometry_as_map_build(ridden):
    growing, ride = ridden
    wheels = begun_at(driven(ride), site.START)
    lidar, _ = lidar_odometry([s.points.astype(np.float64) for s in ride.sweeps], wheels, site.params().lidar_odometry)
    assert len(growing.by_lidar) == len(ride.sweeps) > 50
    np.testing.assert_allclose(np.array(growing.by_wheels), wheels, atol=1e-9)
    np.testing.assert_allclose(np.array(growing.by_lidar), lidar, atol=1e-6)


def test_sweeps_that_come_together_are_all_shown(ridden):
    growing = taught(Collector(site.params().sweeps, load_robot()), together=60)
    assert len(growing.by_lidar) == len(ridden[0].by_lidar)
    np.testing.assert_allclose(growing.by_lidar[-1], ridden[0].by_lidar[-1], atol=1e-6)


def test_teaching_status_reports_distance_size_and_deviation(ridden):
    growing, _ = ridden
    true_m = site.SPEED_MPS * (site.DURATION_S - site.STAND_S)
    assert growing.driven_m == pytest.approx(true_m, abs=1.0)
    width, height = growing.size_m
    assert (width, height) == pytest.approx((12.4, 10.4), abs=0.5), "the room with its walls"
    # The wheels report too much rotation, and the LiDAR measures the difference.
    apart_m, apart_rad = growing.apart
    assert apart_rad == pytest.approx(site.YAW_ERROR_RADPM * true_m, abs=0.03)
    assert apart_m > 0.4
    begin, end = site.true_pose(0.0), site.true_pose(site.recorded().sweeps[-1][0])
    assert growing.from_begin_m == pytest.approx(begin.distance_to(end), abs=0.3)
    assert status_line(growing).startswith(f"{growing.driven_m:.1f} m, {len(growing.by_lidar)} sweeps, 12 x 10 m seen")


def test_structure_contains_walls_and_no_cells_on_path(ridden):
    growing, _ = ridden
    seen, standing = growing.seen, growing.structure
    size_m = site.params().grid.resolution_m
    assert len(seen) > 4 * len(standing) > 0
    centres = (standing + 0.5) * size_m
    walls = (np.abs(centres[:, 0]) > 5.7) | (np.abs(centres[:, 1]) > 4.7)
    assert walls.mean() > 0.5
    # No obstacle is on the robot's path.
    way = np.array([pose[:2, 3] for pose in growing.by_lidar])
    assert np.linalg.norm(centres[:, None] - way[None], axis=2).min() > 0.5


def test_empty_growing_map_reports_zero_status_without_warnings():
    growing = GrowingMap(site.params(), None)
    assert status_line(growing).startswith("0.0 m, 0 sweeps, 0 x 0 m seen")
    assert growing.apart == (0.0, 0.0)
    assert warnings_of(WELL, Motion(site.params().teach), growing, site.params().teach) == []


def stood(seconds: float = 5.0) -> Motion:
    motion = Motion(site.params().teach)
    for step in range(round(50 * seconds) + 1):
        motion.update(0.02 * step, 0.0, 0.0, 0.0)
    return motion


def test_standing_is_measured_and_remembered():
    motion = stood()
    assert motion.standing_s == motion.longest_s == pytest.approx(5.0)
    motion.update(5.02, 0.5, 0.0, 0.0)
    assert motion.standing_s == 0.0
    assert motion.longest_s == pytest.approx(5.0)
    motion.update(5.04, 0.0, 0.0, 0.0)
    motion.update(6.04, 0.0, 0.0, 0.0)
    assert motion.standing_s == pytest.approx(1.0)
    motion.update(1.0, 0.0, 0.0, 0.0)
    assert motion.standing_s == 0.0, "a clock that began anew is no standstill"
    motion.update(2.0, math.nan, 0.0, 0.0)
    assert motion.standing_s == 0.0


def moved(*twist: float) -> Motion:
    motion = stood()
    motion.update(6.0, *twist)
    return motion


def barely_stood() -> Motion:
    motion = stood(1.0)
    motion.update(1.02, 0.5, 0.0, 0.0)
    return motion


@pytest.mark.parametrize(
    ("change", "motion", "words"),
    [
        ({}, moved(0.8, 0.0, 0.2), ""),  # 0.6 m between wheels and LiDAR after 23 m are allowed
        ({"points_age_s": 1.5}, stood(), "no LiDAR sweep"),
        ({"odometry_age_s": 1.5}, stood(), "no odometry"),
        ({"imu_age_s": 1.5}, stood(), "no inertial unit"),
        ({"lost": 1}, stood(), "messages are lost"),
        ({"without_odometry": 6}, stood(), "sweeps without odometry"),
        ({}, moved(0.9, 0.9, 0.0), "too fast"),
        ({}, moved(0.0, 0.0, -0.9), "too fast"),
        ({}, stood(site.params().teach.idle_s + 1.0), "at standstill for more than 30 s"),
        ({}, barely_stood(), "no standstill of"),
    ],
)
def test_warnings(ridden, change, motion, words):
    found = warnings_of(replace(WELL, **change), motion, ridden[0], site.params().teach)
    assert len(found) == bool(words)
    assert words in "".join(found)


def test_wheels_that_slip(ridden):
    settings = site.params().teach.model_copy(update={"apart_m": 0.1, "apart_share": 0.001})
    (found,) = warnings_of(WELL, stood(), ridden[0], settings)
    assert "disagree" in found


def test_open_ground_has_no_structure():
    collector = Collector(site.params().sweeps, load_robot())
    growing = GrowingMap(site.params(), None)
    x, y = (axis.ravel() for axis in np.mgrid[-8.0:8.0:0.4, -8.0:8.0:0.4])
    for step in range(4):
        stamp_s = 0.5 * step
        points = np.zeros(len(x), site.SWEEP)
        points["x"], points["y"], points["z"] = x, y, -load_robot().lidar_xyz_m[2]
        collector.sweep(stamp_s, points)
        for offset in (-0.1, 0.0):
            collector.odometry(stamp_s + offset, 0.5 * (stamp_s + offset) * 2.0, 0.0, 0.0)
        growing.add(collector.newest(2), 1)
    assert not growing.matched
    assert len(growing.structure) == 0
    assert growing.apart == (0.0, 0.0)
    assert growing.driven_m == pytest.approx(1.5)
    (found,) = warnings_of(WELL, stood(), growing, site.params().teach)
    assert "no structure around" in found
