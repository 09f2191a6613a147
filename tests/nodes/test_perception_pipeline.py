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
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import Imu, PointCloud2

from robot_stack.contract import topics
from robot_stack.core.geometry import Pose2
from robot_stack.core.point_cloud import MOVING, XYZ, Points, xyz_of
from robot_stack.middleware.conversions import quaternion_to_msg, time_from_s, time_to_s
from robot_stack.middleware.point_cloud import cloud_message, points_of
from tests.support.peer import Heard, Peer
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for
from tests.unit.perception.scenes import Solid, sweep
from tests.unit.perception.test_overhead import frame

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


def state_at(grid: OccupancyGrid, x_m: float, y_m: float) -> int:
    origin, cell_m = grid.info.origin.position, grid.info.resolution
    column, row = math.floor((x_m - origin.x) / cell_m), math.floor((y_m - origin.y) / cell_m)
    return int(grid.data[row * grid.info.width + column])


def test_obstacles_and_space_of_half_sweeps(node: NodeProcess, peer: Peer, lidar: Lidar) -> None:
    obstacles, space, unseen = (peer.listen(row) for row in (topics.OBSTACLES, topics.SPACE, topics.UNSEEN_SPACE))
    moving, no_ground = peer.listen(topics.MOVING), peer.listen(topics.NO_GROUND)
    peer.repeat(topics.LIDAR_HALF_SWEEP, lidar.half, 20.0)
    wait_for(lambda: len(obstacles.items) >= 10 and len(space.items) >= 5, "ten clouds")
    cloud, ends, grid = obstacles.last, unseen.last, space.last
    assert (cloud.header.frame_id, ends.header.frame_id, grid.header.frame_id) == ("base_link", "base_link", "odom")
    assert abs(time.time() - cloud.header.stamp.sec) < 5.0
    assert moving.last.header.frame_id == "base_link"
    assert len(points_of(moving.last, MOVING)) == 0  # nobody
    assert no_ground.last.header.frame_id == "base_link"
    assert np.abs(xyz_of(points_of(no_ground.last, XYZ))[:, :2]).max() > 0.6
    xyz = xyz_of(points_of(cloud, XYZ))
    assert len(xyz) > 200
    assert 3.9 < xyz[:, 0].min() < 4.1
    assert xyz[:, 1].min() < -2.5, "the other half is shown too"
    assert xyz[:, 1].max() > 2.5
    assert (grid.info.width, grid.info.height, len(grid.data)) == (200, 200, 40000)
    assert state_at(grid, 0.0, 0.0) == state_at(grid, 3.0, 0.0) == state_at(grid, -3.0, 0.0) == 0
    assert 100 in {state_at(grid, x, 0.0) for x in (3.93, 3.98, 4.03, 4.08)}
    assert state_at(grid, 0.7, 0.0) == state_at(grid, 4.9, 0.0) == -1  # too near, and behind the wall
    near = xyz_of(points_of(ends, XYZ))
    assert np.hypot(near[:, 0], near[:, 1]).min() < 1.0
    grids = [time_to_s(m.header.stamp) for m in space.messages]
    assert (grids[-1] - grids[0]) / (len(grids) - 1) == pytest.approx(0.2, abs=0.04)  # 5 Hz in the sweeps' own time
    stamps = [(m.header.stamp.sec, m.header.stamp.nanosec) for m in obstacles.messages]
    assert stamps == sorted(set(stamps))


def test_frames_of_the_overhead_lidar_join_the_obstacles(node: NodeProcess, peer: Peer, lidar: Lidar) -> None:
    """Somebody 2 m ahead whom the half sweeps do not show."""
    obstacles, diagnoses = peer.listen(topics.OBSTACLES), peer.listen(topics.DIAGNOSTICS)
    peer.repeat(topics.LIDAR_HALF_SWEEP, lidar.half, 20.0)
    obstacles.wait(lambda cloud: near(cloud) == 0, "nobody yet")
    shown = frame(people=[Pose2(2.0, 0.0, 0.0)])
    number, name = count(1), ["overhead_lidar"]

    def message() -> PointCloud2:
        points = shown.copy()
        points["z"] += np.float32(1e-5 * next(number))  # no two frames are the same
        cloud = cloud_message(points, name[0])
        cloud.header.stamp = time_from_s(time.time())
        return cloud

    peer.repeat(topics.OVERHEAD_LIDAR_POINTS, message, 10.0)
    obstacles.wait(lambda cloud: near(cloud) > 50, "the person")
    name[0] = "lidar"
    diagnoses.wait(lambda said: "must be 'overhead_lidar'" in str(said), "why it is not used")
    obstacles.wait(lambda cloud: near(cloud) == 0, "nobody any more")
    peer.silence(topics.OVERHEAD_LIDAR_POINTS)
    diagnoses.wait(lambda said: "silent" in str(said), "that it is silent")


def near(cloud: PointCloud2) -> int:
    xyz = xyz_of(points_of(cloud, XYZ))
    return int((np.hypot(xyz[:, 0] - 2.0, xyz[:, 1]) < 0.5).sum())


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
    peer.repeat(topics.ODOM, lambda: broken, 50.0)
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

    def stamps() -> list[tuple[int, int]]:
        return [(m.header.stamp.sec, m.header.stamp.nanosec) for m in heard.messages]

    def again_between() -> bool:
        newest = stamps()[-12:]
        return len(newest) == 12 and len(newest) > 1.3 * len(set(newest))

    wait_for(again_between, "twelve clouds on end, shown again between sweeps")
    assert set(stamps()) <= set(sent), "the stamp is the newest point's"
    assert stamps() == sorted(stamps())
    xyz = xyz_of(points_of(heard.last, XYZ))
    assert 3.9 < xyz[:, 0].min() < 4.1
    # Half sweeps take over once they come.
    peer.repeat(topics.LIDAR_HALF_SWEEP, lidar.half, 20.0)
    wait_for(lambda: peer.publisher(topics.LIDAR_POINTS).get_subscription_count() == 0, "full sweeps left alone")


def test_an_illegal_parameter_stops_the_start(start: Callable[..., NodeProcess]) -> None:
    process = start("perception_pipeline", "-p", "crop.range_min_m:=100.0")
    assert process.wait(60.0) == 2
    assert "range_min_m must be smaller than range_max_m" in process.output()
