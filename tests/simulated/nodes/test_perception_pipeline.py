"""The perception node with a fake LiDAR, fake wheels and a fake inertial unit."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from itertools import count

import numpy as np
import pytest
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import Imu, PointCloud2

from robot_stack.contract import topics
from robot_stack.core.geometry import Pose2
from robot_stack.core.point_cloud import MOVING, PEOPLE, XYZ, Points, xyz_of
from robot_stack.middleware.conversions import quaternion_to_msg, time_to_s
from robot_stack.middleware.point_cloud import cloud_message, points_of
from tests.simulated.bench import Bench
from tests.unit.perception.scenes import Solid, sweep
from tests.unit.perception.test_overhead import frame

WALL = Solid((4.0, -3.0, 0.0), (4.3, 3.0, 2.0))


@cache
def turns() -> tuple[Points, ...]:
    """More turns than the node stores, so no sweep counts as a repetition."""
    return tuple(sweep([WALL], columns=1000, seed=seed) for seed in range(6))


class Scene:
    """The node and its inputs. Left and right halves alternate, each sweep with different noise.

    spoil: changes the points; message: changes the whole message.
    """

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self._number = count()
        self.spoil: Callable[[Points], Points] = lambda points: points
        self.message: Callable[[PointCloud2], object] = lambda message: None
        self.frame_id = "lidar"
        self.stamp_offset_s = 0.0
        self.frozen = False
        self.obstacles, self.space = bench.listen(topics.OBSTACLES), bench.listen(topics.SPACE)
        self.unseen, self.moving = bench.listen(topics.UNSEEN_SPACE), bench.listen(topics.MOVING)
        self.no_ground, self.people = bench.listen(topics.NO_GROUND), bench.listen(topics.PEOPLE)
        self.diagnoses = bench.listen(topics.DIAGNOSTICS)
        # Few columns: the thresholds of sufficient data are not under test.
        given = {"watch.points_min": 3000, "watch.stamp_old_s": 2.0, "watch.sector_silent_s": 0.6}
        bench.start("perception_pipeline", given)
        self.roll()
        bench.repeat(topics.IMU, self._imu, 100.0)

    def roll(self, x_m: float = 0.0) -> None:
        def odometry() -> Odometry:
            message = Odometry()
            message.header.frame_id, message.child_frame_id = "odom", "base_link"
            message.header.stamp = self.bench.stamp()
            message.pose.pose.position.x = x_m
            message.pose.pose.orientation = quaternion_to_msg(0.0)
            return message

        self.bench.repeat(topics.ODOM, odometry, 50.0)

    def _imu(self) -> Imu:
        message = Imu()
        message.header.frame_id = "imu"
        message.header.stamp = self.bench.stamp()
        message.orientation.w = 1.0
        return message

    def see(self) -> None:
        """Publishes half sweeps at 20 Hz."""
        self.bench.repeat(topics.LIDAR_HALF_SWEEP, self._half, 20.0)

    def _half(self) -> PointCloud2:
        step = 0 if self.frozen else next(self._number)
        points = turns()[step // 2 % len(turns())]
        return self._cloud(points[points["y"] >= 0.0] if step % 2 == 0 else points[points["y"] < 0.0])

    def full(self) -> PointCloud2:
        return self._cloud(turns()[next(self._number) % len(turns())])

    def _cloud(self, points: Points) -> PointCloud2:
        message = cloud_message(self.spoil(points), self.frame_id)
        message.header.stamp = self.bench.stamp(self.stamp_offset_s)
        self.message(message)
        return message

    def goes_on(self) -> None:
        begun_s = self.bench.now_s
        self.bench.run(2.0)
        assert len(self.obstacles.since(begun_s + 1.0)) >= 19

    def is_silent(self, reason: str) -> None:
        """Checks that the node publishes nothing and reports the reason."""
        self.bench.run(2.0)
        begun_s = self.bench.now_s
        self.bench.run(2.0)
        assert self.obstacles.since(begun_s) == []
        assert reason in self.bench.log("perception_pipeline")
        texts = [one.message for message in self.diagnoses.since(begun_s) for one in message.status]
        assert texts
        assert all(reason in text for text in texts), texts


@pytest.fixture
def scene(bench: Bench) -> Scene:
    return Scene(bench)


def state_at(grid: OccupancyGrid, x_m: float, y_m: float) -> int:
    origin, cell_m = grid.info.origin.position, grid.info.resolution
    column, row = math.floor((x_m - origin.x) / cell_m), math.floor((y_m - origin.y) / cell_m)
    return int(grid.data[row * grid.info.width + column])


def near(cloud: PointCloud2) -> int:
    xyz = xyz_of(points_of(cloud, XYZ))
    return int((np.hypot(xyz[:, 0] - 2.0, xyz[:, 1]) < 0.5).sum())


def test_obstacles_and_space_of_half_sweeps(scene: Scene) -> None:
    scene.see()
    scene.bench.run(3.0)
    cloud, ends, grid = scene.obstacles.last, scene.unseen.last, scene.space.last
    assert (cloud.header.frame_id, ends.header.frame_id, grid.header.frame_id) == ("base_link", "base_link", "odom")
    assert 0.0 <= scene.bench.stamp_s() - time_to_s(cloud.header.stamp) < 0.06
    assert scene.moving.last.header.frame_id == "base_link"
    assert len(points_of(scene.moving.last, MOVING)) == 0  # no moving body
    assert scene.people.last.header == grid.header
    assert points_of(scene.people.last, PEOPLE)["walked"].sum() == 0
    assert scene.no_ground.last.header.frame_id == "base_link"
    assert np.abs(xyz_of(points_of(scene.no_ground.last, XYZ))[:, :2]).max() > 0.6
    xyz = xyz_of(points_of(cloud, XYZ))
    assert len(xyz) > 200
    assert 3.9 < xyz[:, 0].min() < 4.1
    assert xyz[:, 1].min() < -2.5, "the other half is shown too"
    assert xyz[:, 1].max() > 2.5
    assert (grid.info.width, grid.info.height, len(grid.data)) == (200, 200, 40000)
    assert state_at(grid, 0.0, 0.0) == state_at(grid, 3.0, 0.0) == state_at(grid, -3.0, 0.0) == 0
    assert 100 in {state_at(grid, x, 0.0) for x in (3.93, 3.98, 4.03, 4.08)}
    assert state_at(grid, 0.7, 0.0) == state_at(grid, 4.9, 0.0) == -1  # too near, and behind the wall
    seen = xyz_of(points_of(ends, XYZ))
    assert np.hypot(seen[:, 0], seen[:, 1]).min() < 1.0
    assert scene.obstacles.period_s() == pytest.approx(0.05, abs=1e-4)
    grids = [time_to_s(m.header.stamp) for m in scene.space.messages[-10:]]
    assert np.diff(grids) == pytest.approx([0.2] * 9, abs=1e-6)  # 5 Hz in sweep stamps
    stamps = [time_to_s(m.header.stamp) for m in scene.obstacles.messages]
    assert stamps == sorted(set(stamps))


def test_frames_of_the_overhead_lidar_join_the_obstacles(scene: Scene) -> None:
    """A person 2 m ahead who is missing in the half sweeps."""
    shown = frame(people=[Pose2(2.0, 0.0, 0.0)])
    number, name = count(1), ["overhead_lidar"]

    def message() -> PointCloud2:
        points = shown.copy()
        points["z"] += np.float32(1e-5 * next(number))  # each frame differs, as from a real sensor
        cloud = cloud_message(points, name[0])
        cloud.header.stamp = scene.bench.stamp()
        return cloud

    scene.see()
    scene.goes_on()
    assert near(scene.obstacles.last) == 0
    scene.bench.repeat(topics.OVERHEAD_LIDAR_POINTS, message, 10.0)
    scene.obstacles.wait(lambda cloud: near(cloud) > 50, "the person", 1.0)
    name[0] = "lidar"
    scene.diagnoses.wait(lambda said: "must be 'overhead_lidar'" in str(said), "why it is not used")
    scene.obstacles.wait(lambda cloud: near(cloud) == 0, "nobody any more")
    scene.bench.silence(topics.OVERHEAD_LIDAR_POINTS)
    scene.diagnoses.wait(lambda said: "silent" in str(said), "that it is silent")


def test_silence_is_silence(scene: Scene) -> None:
    scene.see()
    scene.goes_on()
    scene.bench.silence(topics.LIDAR_HALF_SWEEP)
    scene.is_silent("the LiDAR is silent")
    scene.see()
    scene.goes_on()


def test_frozen_and_covered_sensors_are_reported_as_such(scene: Scene) -> None:
    scene.see()
    scene.goes_on()
    scene.frozen = True
    scene.is_silent("frozen: equal to earlier points")
    scene.frozen = False
    scene.goes_on()
    scene.spoil = lambda points: points[::20]
    scene.is_silent("covered")


def test_sweeps_that_cannot_be_are_refused(scene: Scene) -> None:
    scene.frame_id = "base_link"
    scene.see()
    scene.is_silent("frame_id is 'base_link', must be 'lidar'")
    scene.frame_id, scene.stamp_offset_s = "lidar", 5.0
    scene.is_silent("in the future")
    scene.stamp_offset_s = -10.0
    scene.is_silent("old, limit 2.0 s")
    assert scene.obstacles.items == []
    scene.stamp_offset_s = 0.0
    scene.goes_on()
    scene.message = lambda message: setattr(message, "width", message.width + 1)
    scene.is_silent("bytes are not")


def test_no_output_without_odometry(scene: Scene) -> None:
    scene.see()
    scene.goes_on()
    scene.bench.silence(topics.ODOM)
    scene.is_silent("/odom is")
    scene.roll(math.nan)
    scene.is_silent("/odom is")


def test_a_driver_with_full_sweeps_only_gives_20_hz_with_honest_stamps(scene: Scene) -> None:
    sent: list[float] = []

    def full() -> PointCloud2:
        message = scene.full()
        sent.append(time_to_s(message.header.stamp))
        return message

    scene.bench.repeat(topics.LIDAR_POINTS, full, 10.0)
    scene.bench.run(4.0)
    assert scene.obstacles.period_s() == pytest.approx(0.05, abs=2e-3)
    stamps = [time_to_s(message.header.stamp) for message in scene.obstacles.messages]
    assert set(stamps) <= set(sent), "the stamp is the newest point's"
    assert stamps == sorted(stamps)
    assert len(set(stamps[-20:])) in (10, 11), "shown again between sweeps"
    xyz = xyz_of(points_of(scene.obstacles.last, XYZ))
    assert 3.9 < xyz[:, 0].min() < 4.1
    # Half sweeps replace full sweeps as soon as they arrive.
    scene.see()
    full_sweeps = scene.bench.publisher(topics.LIDAR_POINTS)
    scene.bench.wait(lambda: full_sweeps.get_subscription_count() == 0, "full sweeps left alone")
