"""The localization node among fake wheels and a fake IMU."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, PointCloud2

from robot_stack.contract import topics
from robot_stack.core.geometry import IDENTITY
from robot_stack.core.site_map import Grid, SiteMap, save_map
from robot_stack.middleware.conversions import pose_from_msg, quaternion_to_msg, time_from_s, time_to_s
from robot_stack.middleware.point_cloud import cloud_message
from tests.support.blind import WITHOUT_MAP
from tests.support.held_up import HeldUp
from tests.support.peer import Peer
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for
from tests.unit.localization.courtyard import cells, sweep_from


class Wheels:
    """A robot that drives straight at ``speed_mps`` by its odometry and turns by nothing."""

    def __init__(self, speed_mps: float = 0.0) -> None:
        self.speed_mps = speed_mps
        self.x_m = 0.0
        self._last_s = time.time()

    def odometry(self) -> Odometry:
        now_s = time.time()
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


class Gyro:
    def __init__(self) -> None:
        self.count = 0

    def imu(self) -> Imu:
        self.count += 1
        message = Imu()
        message.header.frame_id = "imu"
        message.header.stamp = time_from_s(time.time())
        message.angular_velocity.z = 1e-4 * (self.count % 3)
        message.linear_acceleration.z = 9.81
        return message


@pytest.fixture
def node(start: Callable[..., NodeProcess], peer: Peer) -> NodeProcess:
    process = start("ndt_localization", *WITHOUT_MAP, "-p", "start_x_m:=2.0", "-p", "start_yaw_rad:=1.0")
    peer.wait_matched(topics.ODOM)
    peer.wait_matched(topics.IMU)
    return process


def test_pose_quality_and_transform_come_at_their_rate(node: NodeProcess, peer: Peer) -> None:
    wheels, gyro = Wheels(), Gyro()
    poses, qualities, transforms = (
        peer.listen(row) for row in (topics.CURRENT_POSE, topics.LOCALIZATION_QUALITY, topics.TF)
    )
    peer.repeat(topics.ODOM, wheels.odometry, 50.0)
    peer.repeat(topics.IMU, gyro.imu, 100.0)
    poses.wait_period(0.1, count=31)
    pose = poses.last.pose
    assert poses.last.header.frame_id == "map"
    assert pose.position.x == pytest.approx(2.0, abs=1e-3)
    assert pose_from_msg(pose).yaw == pytest.approx(1.0, abs=1e-3)
    assert abs(time.time() - time_to_s(poses.last.header.stamp)) < 0.5
    assert qualities.wait(lambda message: message.data > 0.8, "quality above 0.8")
    transform = transforms.last.transforms[0]
    assert (transform.header.frame_id, transform.child_frame_id) == ("map", "odom")
    assert transform.transform.translation.x == pytest.approx(2.0, abs=1e-3)


def test_pose_comes_with_a_covariance_that_grows_with_the_way(node: NodeProcess, peer: Peer) -> None:
    wheels, gyro = Wheels(), Gyro()
    poses = peer.listen(topics.LOCALIZATION_POSE)
    peer.repeat(topics.ODOM, wheels.odometry, 50.0)
    peer.repeat(topics.IMU, gyro.imu, 100.0)
    poses.wait_period(0.1, count=11)
    first = poses.last
    assert first.header.frame_id == "map"
    assert first.pose.pose.position.x == pytest.approx(2.0, abs=1e-3)
    assert [index for index, value in enumerate(first.pose.covariance) if index % 7 == 0 and value > 0.0] == [0, 7, 35]
    wheels.speed_mps = 1.0
    poses.wait(lambda message: message.pose.covariance[0] > first.pose.covariance[0] + 1e-4, "a larger variance")


def test_motion_of_the_wheels_moves_the_pose_along_the_start_heading(node: NodeProcess, peer: Peer) -> None:
    wheels, gyro = Wheels(), Gyro()
    poses = peer.listen(topics.CURRENT_POSE)
    peer.repeat(topics.ODOM, wheels.odometry, 50.0)
    peer.repeat(topics.IMU, gyro.imu, 100.0)
    poses.wait(lambda _: True, "a pose")
    wheels.speed_mps = 1.0
    wait_for(lambda: wheels.x_m > 1.0, "1 m of driving")
    wheels.speed_mps = 0.0
    stopped_s = time.time()
    poses.wait(lambda message: time_to_s(message.header.stamp) > stopped_s + 0.1, "a pose after the stop")
    position = poses.last.pose.position
    # The gyro of this test turns by 1e-4 rad/s on average: nothing in a second.
    assert position.x - 2.0 == pytest.approx(wheels.x_m * math.cos(1.0), abs=0.01)
    assert position.y == pytest.approx(wheels.x_m * math.sin(1.0), abs=0.01)


def test_silent_odometry_silences_the_pose_and_drops_the_quality(node: NodeProcess, peer: Peer) -> None:
    wheels = Wheels()
    poses, qualities = peer.listen(topics.CURRENT_POSE), peer.listen(topics.LOCALIZATION_QUALITY)
    peer.repeat(topics.ODOM, wheels.odometry, 50.0)
    poses.wait(lambda _: True, "a pose")
    peer.silence(topics.ODOM)
    with HeldUp() as machine:
        silent_s = time.monotonic()
        qualities.wait(lambda message: message.data == 0.0, "quality 0")
        assert time.monotonic() - silent_s - machine.seconds < 1.0
    count, heard = len(poses.items), len(qualities.items)
    wait_for(lambda: len(qualities.items) >= heard + 5, "five more qualities")
    assert len(poses.items) == count
    peer.repeat(topics.ODOM, wheels.odometry, 50.0)
    wait_for(lambda: len(poses.items) > count, "the pose again")


def test_without_imu_the_wheels_go_on_at_lower_quality(node: NodeProcess, peer: Peer) -> None:
    qualities = peer.listen(topics.LOCALIZATION_QUALITY)
    peer.repeat(topics.ODOM, Wheels().odometry, 50.0)
    qualities.wait(lambda message: 0.5 < message.data < 0.75, "the quality of wheels alone")
    peer.repeat(topics.IMU, Gyro().imu, 100.0)
    qualities.wait(lambda message: message.data > 0.8, "the quality with the gyro")


def given_pose(x_m: float, yaw_rad: float = 0.0, frame_id: str = "map") -> PoseWithCovarianceStamped:
    message = PoseWithCovarianceStamped()
    message.header.frame_id = frame_id
    message.header.stamp = time_from_s(time.time())
    message.pose.pose.position.x = x_m
    message.pose.pose.orientation = quaternion_to_msg(yaw_rad)
    return message


def test_initialpose_corrects_and_bad_ones_are_refused(node: NodeProcess, peer: Peer) -> None:
    poses = peer.listen(topics.CURRENT_POSE)
    peer.repeat(topics.ODOM, Wheels().odometry, 50.0)
    peer.wait_matched(topics.INITIAL_POSE)
    poses.wait(lambda _: True, "a pose")
    peer.publish(topics.INITIAL_POSE, given_pose(7.0))
    poses.wait(lambda message: abs(message.pose.position.x - 7.0) < 1e-3, "the given pose")
    peer.publish(topics.INITIAL_POSE, given_pose(math.nan))
    node.wait_output("pose is not finite")
    peer.publish(topics.INITIAL_POSE, given_pose(9.0, frame_id="odom"))
    node.wait_output("must be 'map'")
    crooked = given_pose(9.0)
    crooked.pose.pose.orientation.w = 5.0
    peer.publish(topics.INITIAL_POSE, crooked)
    node.wait_output("no unit quaternion")
    count = len(poses.items)
    wait_for(lambda: len(poses.items) > count + 2, "poses after the refusals")
    assert poses.last.pose.position.x == pytest.approx(7.0, abs=1e-3)


def test_nan_odometry_is_named_and_stops_the_pose(node: NodeProcess, peer: Peer) -> None:
    poses, qualities = peer.listen(topics.CURRENT_POSE), peer.listen(topics.LOCALIZATION_QUALITY)
    wheels = Wheels()
    peer.repeat(topics.ODOM, wheels.odometry, 50.0)
    poses.wait(lambda _: True, "a pose")

    def broken() -> Odometry:
        message = wheels.odometry()
        message.pose.pose.position.x = math.nan
        return message

    peer.repeat(topics.ODOM, broken, 50.0)
    node.wait_output("/odom pose is not finite")
    qualities.wait(lambda message: message.data == 0.0, "quality 0")
    assert all(math.isfinite(message.pose.position.x) for message in poses.messages)


def test_illegal_parameter_stops_the_start(start: Callable[..., NodeProcess]) -> None:
    process = start("ndt_localization", "-p", "quality.odometry_silent_s:=0.05")
    assert process.wait() == 2
    assert "odometry_fresh_s must be smaller than odometry_silent_s" in process.output()


@pytest.fixture
def courtyard(tmp_path: Path) -> Path:
    """A folder with the map of the unit tests' courtyard."""
    folder = tmp_path / "courtyard"
    save_map(SiteMap("courtyard", cells(), Grid(1.0, -8.0, -6.0, np.zeros((14, 20), np.int8))), folder)
    return folder


class Sweeps:
    """What a LiDAR sees from the middle of the courtyard, never twice the same."""

    def __init__(self) -> None:
        self._sweeps = itertools.cycle([sweep_from(IDENTITY, seed, density=5.0) for seed in range(5)])

    def cloud(self) -> PointCloud2:
        message = cloud_message(next(self._sweeps), "lidar")
        message.header.stamp = time_from_s(time.time())
        return message


def test_with_a_map_a_wrong_start_is_corrected_and_a_silent_sensor_lowers_the_quality(
    start: Callable[..., NodeProcess], peer: Peer, courtyard: Path
) -> None:
    given = ("start_x_m:=0.7", "start_y_m:=-0.7", "start_yaw_rad:=0.17", f"map:={courtyard}")
    node = start("ndt_localization", *itertools.chain.from_iterable(("-p", item) for item in given))
    node.wait_output("cells of 0.5 m")
    poses, qualities = peer.listen(topics.CURRENT_POSE), peer.listen(topics.LOCALIZATION_QUALITY)
    peer.repeat(topics.ODOM, Wheels().odometry, 50.0)
    peer.repeat(topics.IMU, Gyro().imu, 100.0)
    qualities.wait(lambda message: message.data < 0.3, "a quality before any match")
    peer.wait_matched(topics.LIDAR_POINTS)
    peer.repeat(topics.LIDAR_POINTS, Sweeps().cloud, 10.0)
    qualities.wait(lambda message: message.data > 0.5, "the quality of a confirmed pose", deadline_s=60.0)
    position = poses.last.pose.position
    assert math.hypot(position.x, position.y) < 0.03
    peer.silence(topics.LIDAR_POINTS)
    qualities.wait(lambda message: message.data < 0.3, "the quality without sweeps")
    count = len(poses.items)
    wait_for(lambda: len(poses.items) > count + 5, "poses by wheels and gyro")
    peer.repeat(topics.LIDAR_POINTS, Sweeps().cloud, 10.0)
    qualities.wait(lambda message: message.data > 0.5, "the quality again")


def test_a_map_that_is_missing_or_damaged_stops_the_start(start: Callable[..., NodeProcess], courtyard: Path) -> None:
    missing = start("ndt_localization", "-p", "map:=nowhere")
    assert missing.wait() == 2
    assert "no map 'nowhere'" in missing.output()
    (courtyard / "grid.pgm").write_bytes(b"P5\n1 1\n255\n0")
    damaged = start("ndt_localization", "-p", f"map:={courtyard}")
    assert damaged.wait() == 2
    assert "grid.pgm is missing or is not the file" in damaged.output()
