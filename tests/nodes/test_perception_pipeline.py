"""The perception node among a fake LiDAR, fake wheels and a fake inertial unit."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from itertools import count

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, PointCloud2

from robot_stack.contract import topics
from robot_stack.core.point_cloud import XYZ, Points, xyz_of
from robot_stack.ros.conversions import quaternion_to_msg, time_from_s
from robot_stack.ros.point_cloud import cloud_message, points_of
from tests.support.peer import Heard, Peer
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for
from tests.unit.perception.scenes import Solid, sweep

WALL = Solid((4.0, -3.0, 0.0), (4.3, 3.0, 2.0))


def odometry() -> Odometry:
    message = Odometry()
    message.header.frame_id, message.child_frame_id = "odom", "base_link"
    message.header.stamp = time_from_s(time.time())
    message.pose.pose.orientation = quaternion_to_msg(0.0)
    return message


def imu() -> Imu:
    message = Imu()
    message.header.frame_id = "imu"
    message.header.stamp = time_from_s(time.time())
    message.orientation.w = 1.0
    return message


@cache
def turns() -> tuple[Points, ...]:
    """More of them than the node remembers."""
    return tuple(sweep([WALL], columns=1000, seed=seed) for seed in range(6))


@dataclass
class Lidar:
    """Left and right halves in turn, of sweeps with noise of their own; ``spoil`` changes points or message."""

    turns: tuple[Points, ...] = field(default_factory=lambda: turns())
    number: Iterator[int] = field(default_factory=count)
    spoil: Callable[[Points], Points] = lambda points: points
    frame_id: str = "lidar"
    stamp_offset_s: float = 0.0
    frozen: bool = False

    def half(self) -> PointCloud2:
        step = 0 if self.frozen else next(self.number)
        points = self.turns[step // 2 % len(self.turns)]
        return self._message(points[points["y"] >= 0.0] if step % 2 == 0 else points[points["y"] < 0.0])

    def full(self) -> PointCloud2:
        return self._message(self.turns[next(self.number) % len(self.turns)])

    def _message(self, points: Points) -> PointCloud2:
        message = cloud_message(self.spoil(points), self.frame_id)
        message.header.stamp = time_from_s(time.time() + self.stamp_offset_s)
        return message


@pytest.fixture
def lidar() -> Lidar:
    return Lidar()


@pytest.fixture
def node(start: Callable[..., NodeProcess], peer: Peer) -> NodeProcess:
    # Few columns, and a machine that may be busy: what is tested is not how much is enough.
    process = start(
        "perception_pipeline", "-p", "watch.points_min:=3000", "-p", "watch.stamp_old_s:=2.0", "-p",
        "watch.sector_silent_s:=0.6", "-p", "deskew.odometry_silent_s:=0.5",
    )  # fmt: skip
    peer.repeat(topics.ODOM, odometry, 50.0)
    peer.repeat(topics.IMU, imu, 100.0)
    peer.publisher(topics.LIDAR_HALF_SWEEP)
    wait_for(
        lambda: not process.running() or peer.publisher(topics.LIDAR_HALF_SWEEP).get_subscription_count(),
        "the node's subscription",
        deadline_s=60.0,
    )
    assert process.running(), process.output()
    return process


def silent_from_now(heard: Heard, peer: Peer, process: NodeProcess, reason: str) -> None:
    """The node says why, and publishes nothing while it lasts."""
    process.wait_output(reason)
    settled = len(heard.items)
    diagnoses = peer.listen(topics.DIAGNOSTICS)
    wait_for(lambda: len(diagnoses.items) >= 2, "two diagnoses")
    assert len(heard.items) <= settled + 1
    assert reason in diagnoses.last.status[0].message


def test_obstacles_and_free_space_of_half_sweeps(node: NodeProcess, peer: Peer, lidar: Lidar) -> None:
    obstacles, free = peer.listen(topics.OBSTACLES), peer.listen(topics.FREE_SPACE)
    peer.repeat(topics.LIDAR_HALF_SWEEP, lidar.half, 20.0)
    wait_for(lambda: len(obstacles.items) >= 10 and len(free.items) >= 10, "ten clouds")
    cloud, scan = obstacles.last, free.last
    assert cloud.header.frame_id == scan.header.frame_id == "base_link"
    assert abs(time.time() - cloud.header.stamp.sec) < 5.0
    xyz = xyz_of(points_of(cloud, XYZ))
    assert len(xyz) > 200
    assert 3.9 < xyz[:, 0].min() < 4.1
    assert xyz[:, 1].min() < -2.5, "the other half is shown too"
    assert xyz[:, 1].max() > 2.5
    ahead = np.asarray(scan.ranges)[350:370]
    assert ((ahead == 0.0) | (ahead > 3.5)).all()
    assert (ahead < 4.2).all()
    assert len(scan.ranges) == round((scan.angle_max - scan.angle_min) / scan.angle_increment) + 1 == 720
    stamps = [(m.header.stamp.sec, m.header.stamp.nanosec) for m in obstacles.messages]
    assert stamps == sorted(set(stamps))


def test_silence_is_silence(node: NodeProcess, peer: Peer, lidar: Lidar) -> None:
    heard = peer.listen(topics.OBSTACLES)
    peer.repeat(topics.LIDAR_HALF_SWEEP, lidar.half, 20.0)
    wait_for(lambda: heard.items, "obstacles")
    peer.silence(topics.LIDAR_HALF_SWEEP)
    silent_from_now(heard, peer, node, "the LiDAR is silent")
    peer.repeat(topics.LIDAR_HALF_SWEEP, lidar.half, 20.0)
    before = len(heard.items)
    wait_for(lambda: len(heard.items) > before + 2, "obstacles again")


def test_a_frozen_a_covered_and_a_blind_sensor_say_so_and_nothing_else(
    node: NodeProcess, peer: Peer, lidar: Lidar
) -> None:
    heard = peer.listen(topics.OBSTACLES)
    peer.repeat(topics.LIDAR_HALF_SWEEP, lidar.half, 20.0)
    wait_for(lambda: heard.items, "obstacles")
    lidar.frozen = True
    silent_from_now(heard, peer, node, "frozen: the same points came before")
    lidar.frozen = False
    before = len(heard.items)
    wait_for(lambda: len(heard.items) > before + 2, "obstacles again")
    lidar.spoil = lambda points: points[::20]
    silent_from_now(heard, peer, node, "covered")
    lidar.spoil = lambda points: points[np.abs(np.arctan2(points["y"], points["x"])) > 1.0]
    silent_from_now(heard, peer, node, "blind in")


def test_sweeps_that_cannot_be_are_refused(node: NodeProcess, peer: Peer, lidar: Lidar) -> None:
    heard = peer.listen(topics.OBSTACLES)
    lidar.frame_id = "base_link"
    peer.repeat(topics.LIDAR_HALF_SWEEP, lidar.half, 20.0)
    node.wait_output("frame_id is 'base_link', must be 'lidar'")
    lidar.frame_id, lidar.stamp_offset_s = "lidar", 5.0
    node.wait_output("in the future")
    lidar.stamp_offset_s = -10.0
    node.wait_output("old, limit 2.0 s")
    lidar.stamp_offset_s = 0.0
    assert not heard.items
    wait_for(lambda: heard.items, "obstacles")

    def short() -> PointCloud2:
        message = lidar.half()
        message.width += 1
        return message

    peer.repeat(topics.LIDAR_HALF_SWEEP, short, 20.0)
    node.wait_output("bytes are not")
    assert node.running()


def test_without_odometry_nothing_is_published(node: NodeProcess, peer: Peer, lidar: Lidar) -> None:
    heard = peer.listen(topics.OBSTACLES)
    peer.repeat(topics.LIDAR_HALF_SWEEP, lidar.half, 20.0)
    wait_for(lambda: heard.items, "obstacles")
    peer.silence(topics.ODOM)
    node.wait_output("/odom is")
    broken = odometry()
    broken.pose.pose.position.x = math.nan
    peer.publish(topics.ODOM, broken)
    silent_from_now(heard, peer, node, "/odom is")


def test_a_driver_with_full_sweeps_only_gives_20_hz_with_honest_stamps(
    node: NodeProcess, peer: Peer, lidar: Lidar
) -> None:
    heard = peer.listen(topics.OBSTACLES)
    sent: list[tuple[int, int]] = []

    def full() -> PointCloud2:
        message = lidar.full()
        sent.append((message.header.stamp.sec, message.header.stamp.nanosec))
        return message

    peer.repeat(topics.LIDAR_POINTS, full, 10.0)
    wait_for(lambda: len(heard.items) >= 12, "twelve clouds")
    stamps = [(m.header.stamp.sec, m.header.stamp.nanosec) for m in heard.messages]
    assert set(stamps) <= set(sent), "the stamp is the newest point's"
    assert stamps == sorted(stamps)
    assert len(stamps) > 1.3 * len(set(stamps)), "shown again between sweeps"
    xyz = xyz_of(points_of(heard.last, XYZ))
    assert 3.9 < xyz[:, 0].min() < 4.1
    # Half sweeps take over once they come.
    peer.repeat(topics.LIDAR_HALF_SWEEP, lidar.half, 20.0)
    wait_for(lambda: peer.publisher(topics.LIDAR_POINTS).get_subscription_count() == 0, "full sweeps left alone")


def test_an_illegal_parameter_stops_the_start(start: Callable[..., NodeProcess]) -> None:
    process = start("perception_pipeline", "-p", "crop.range_min_m:=100.0")
    assert process.wait(60.0) == 2
    assert "range_min_m must be smaller than range_max_m" in process.output()
