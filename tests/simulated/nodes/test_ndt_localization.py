"""The localization node with fake wheels and a fake IMU."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, PointCloud2

from robot_stack.contract import topics
from robot_stack.core.geometry import IDENTITY
from robot_stack.core.point_cloud import XYZ, xyz_of
from robot_stack.core.site_map import FREE, OCCUPIED, UNKNOWN, Grid, SiteMap, save_map
from robot_stack.middleware.conversions import pose_from_msg, quaternion_to_msg, time_from_s, time_to_s
from robot_stack.middleware.point_cloud import cloud_message, points_of
from tests.simulated.bench import COMPUTE_S, JOB_S, LATENCY_S, Bench
from tests.unit.localization.courtyard import cells, sweep_from

PERIOD_S = 0.1


class Scene:
    """The node, and a robot whose odometry drives straight at ``speed_mps`` without turning."""

    def __init__(self, bench: Bench, **parameters: Any) -> None:
        self.bench = bench
        self.speed_mps = self.x_m = 0.0
        self._last_s = bench.stamp_s()
        self._samples = 0
        self.poses, self.qualities = bench.listen(topics.CURRENT_POSE), bench.listen(topics.LOCALIZATION_QUALITY)
        bench.start("ndt_localization", parameters or {"map": "", "start_x_m": 2.0, "start_yaw_rad": 1.0})

    def roll(self) -> None:
        self.bench.repeat(topics.ODOM, self.odometry, 50.0)

    def turn(self) -> None:
        """Starts the inertial unit."""
        self.bench.repeat(topics.IMU, self._imu, 100.0)

    def odometry(self) -> Odometry:
        now_s = self.bench.stamp_s()
        self.x_m += self.speed_mps * (now_s - self._last_s)
        self._last_s = now_s
        message = Odometry()
        message.header.frame_id, message.child_frame_id = "odom", "base_link"
        message.header.stamp = time_from_s(now_s)
        message.pose.pose.position.x = self.x_m
        message.pose.pose.orientation = quaternion_to_msg(0.0)
        message.pose.covariance[0] = message.pose.covariance[7] = message.pose.covariance[35] = 1e-6
        message.twist.twist.linear.x = self.speed_mps
        return message

    def _imu(self) -> Imu:
        self._samples += 1
        message = Imu()
        message.header.frame_id = "imu"
        message.header.stamp = self.bench.stamp()
        message.angular_velocity.z = 1e-4 * (self._samples % 3)
        message.linear_acceleration.z = 9.81
        return message

    def correct(self, x_m: float, frame_id: str = "map", w: float | None = None) -> None:
        message = PoseWithCovarianceStamped()
        message.header.frame_id = frame_id
        message.header.stamp = self.bench.stamp()
        message.pose.pose.position.x = x_m
        message.pose.pose.orientation = quaternion_to_msg(0.0)
        if w is not None:
            message.pose.pose.orientation.w = w
        self.bench.publish(topics.INITIAL_POSE, message)
        self.bench.run(0.3)

    def log(self) -> str:
        return self.bench.log("ndt_localization")


@pytest.fixture
def scene(bench: Bench) -> Scene:
    return Scene(bench)


def test_pose_quality_and_transform_come_at_their_rate(scene: Scene) -> None:
    transforms = scene.bench.listen(topics.TF)
    scene.roll()
    scene.turn()
    scene.bench.run(4.0)
    for received in (scene.poses, scene.qualities):
        assert received.period_s(30) == pytest.approx(PERIOD_S, abs=1e-4)
    message = scene.poses.last
    assert message.header.frame_id == "map"
    assert message.pose.position.x == pytest.approx(2.0, abs=1e-3)
    assert pose_from_msg(message.pose).yaw == pytest.approx(1.0, abs=1e-3)
    newest_s = scene.bench.stamp_s() - (scene.bench.now_s - scene.poses.times_s[-1])
    assert 0.0 <= newest_s - time_to_s(message.header.stamp) <= 0.02 + 2.0 * (LATENCY_S + COMPUTE_S)
    assert scene.qualities.last.data > 0.8
    transform = transforms.last.transforms[0]
    assert (transform.header.frame_id, transform.child_frame_id) == ("map", "odom")
    assert transform.transform.translation.x == pytest.approx(2.0, abs=1e-3)


def test_pose_covariance_grows_with_driven_distance(scene: Scene) -> None:
    poses = scene.bench.listen(topics.LOCALIZATION_POSE)
    scene.roll()
    scene.turn()
    scene.bench.run(2.0)
    assert poses.period_s(10) == pytest.approx(PERIOD_S, abs=1e-4)
    first = poses.last
    assert first.header.frame_id == "map"
    assert first.pose.pose.position.x == pytest.approx(2.0, abs=1e-3)
    assert [index for index, value in enumerate(first.pose.covariance) if index % 7 == 0 and value > 0.0] == [0, 7, 35]
    scene.speed_mps = 1.0
    poses.wait(lambda message: message.pose.covariance[0] > first.pose.covariance[0] + 1e-4, "a larger variance")


def test_motion_of_the_wheels_moves_the_pose_along_the_start_heading(scene: Scene) -> None:
    scene.roll()
    scene.turn()
    scene.bench.run(0.5)
    scene.speed_mps = 1.0
    scene.bench.run(1.0)
    scene.speed_mps = 0.0
    scene.bench.run(0.3)
    position = scene.poses.last.pose.position
    # The gyro of this test turns by 1e-4 rad/s on average, which is negligible in a second.
    assert scene.x_m == pytest.approx(1.0, abs=0.03)
    assert position.x - 2.0 == pytest.approx(scene.x_m * math.cos(1.0), abs=1e-3)
    assert position.y == pytest.approx(scene.x_m * math.sin(1.0), abs=1e-3)


def test_silent_odometry_silences_the_pose_and_drops_the_quality(scene: Scene) -> None:
    scene.roll()
    scene.bench.run(1.0)
    silent_s = scene.bench.now_s
    scene.bench.silence(topics.ODOM)
    scene.qualities.wait(lambda message: message.data == 0.0, "quality 0")
    # The newest odometry is up to 20 ms older.
    assert 0.48 <= scene.bench.now_s - silent_s <= 0.5 + PERIOD_S + 0.01
    begun_s = scene.bench.now_s
    scene.bench.run(1.0)
    assert {message.data for message in scene.qualities.since(begun_s)} == {0.0}
    assert scene.poses.since(begun_s) == []
    scene.roll()
    scene.poses.wait_next(3, 1.0)


def test_without_imu_the_wheels_go_on_at_lower_quality(scene: Scene) -> None:
    scene.roll()
    scene.bench.run(2.0)
    assert 0.5 < scene.qualities.last.data < 0.75
    scene.turn()
    scene.bench.run(2.0)
    assert scene.qualities.last.data > 0.8
    scene.bench.silence(topics.IMU)
    scene.bench.run(2.0)
    assert 0.5 < scene.qualities.last.data < 0.75


def test_initialpose_corrects_and_bad_ones_are_refused(scene: Scene) -> None:
    scene.roll()
    scene.poses.wait()
    scene.correct(7.0)
    assert scene.poses.last.pose.position.x == pytest.approx(7.0, abs=1e-3)
    for x_m, options, reason in (
        (math.nan, {}, "pose is not finite"),
        (9.0, {"frame_id": "odom"}, "must be 'map'"),
        (9.0, {"w": 5.0}, "no unit quaternion"),
    ):
        scene.bench.run(1.0)
        scene.correct(x_m, **options)
        assert reason in scene.log()
        assert scene.poses.last.pose.position.x == pytest.approx(7.0, abs=1e-3)


def test_map_is_published_for_subscribers_that_start_later(bench: Bench, tmp_path: Path) -> None:
    occupancy = np.full((14, 20), UNKNOWN, np.int8)
    occupancy[3, 5:9], occupancy[4:10, 2] = FREE, OCCUPIED
    site = SiteMap("courtyard", cells(), Grid(0.5, -8.0, -6.0, occupancy))
    save_map(site, tmp_path / "courtyard")
    Scene(bench, map=str(tmp_path / "courtyard"))
    bench.run(1.0)
    grid, cloud = bench.listen(topics.MAP).wait(), bench.listen(topics.MAP_CLOUD).wait()
    assert (grid.header.frame_id, cloud.header.frame_id) == ("map", "map")
    assert (grid.info.width, grid.info.height, grid.info.resolution) == (20, 14, 0.5)
    origin = grid.info.origin
    assert (origin.position.x, origin.position.y, origin.orientation.w) == (-8.0, -6.0, 1.0)
    assert np.array_equal(np.reshape(grid.data, (14, 20)), occupancy)  # row 0 at the lowest y, as Nav2 has it
    assert xyz_of(points_of(cloud, XYZ)) == pytest.approx(site.cells.mean.astype(np.float32))


def test_without_a_map_none_is_published(scene: Scene) -> None:
    grid, cloud = scene.bench.listen(topics.MAP), scene.bench.listen(topics.MAP_CLOUD)
    scene.bench.run(1.0)
    assert not grid.messages
    assert not cloud.messages


def test_with_a_map_a_wrong_start_is_corrected_and_a_silent_sensor_lowers_the_quality(
    bench: Bench, tmp_path: Path
) -> None:
    folder = tmp_path / "courtyard"
    save_map(SiteMap("courtyard", cells(), Grid(1.0, -8.0, -6.0, np.zeros((14, 20), np.int8))), folder)
    # LiDAR sweeps from the middle of the courtyard, each with different noise.
    sweeps = itertools.cycle([sweep_from(IDENTITY, seed, density=5.0) for seed in range(5)])

    def cloud() -> PointCloud2:
        message = cloud_message(next(sweeps), "lidar")
        message.header.stamp = bench.stamp()
        return message

    scene = Scene(bench, map=str(folder), start_x_m=0.7, start_y_m=-0.7, start_yaw_rad=0.17)
    scene.roll()
    scene.turn()
    bench.run(2.0)
    assert scene.qualities.last.data < 0.3  # before any match
    bench.repeat(topics.LIDAR_POINTS, cloud, 10.0)
    scene.qualities.wait(lambda message: message.data > 0.5, "the quality of a confirmed pose")
    position = scene.poses.last.pose.position
    assert math.hypot(position.x, position.y) < 0.03
    silent_s = bench.now_s
    bench.silence(topics.LIDAR_POINTS)
    scene.qualities.wait(lambda message: message.data < 0.3, "the quality without sweeps")
    assert 0.3 < bench.now_s - silent_s <= 1.5 + PERIOD_S + JOB_S + 0.1
    begun_s = bench.now_s
    bench.run(1.0)
    assert len(scene.poses.since(begun_s)) >= 9, "poses by wheels and gyro"
    bench.repeat(topics.LIDAR_POINTS, cloud, 10.0)
    scene.qualities.wait(lambda message: message.data > 0.5, "the quality again")
