"""The costmap server among fake wheels and fake perception."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan, PointCloud2
from std_msgs.msg import Bool

from robot_stack.contract import topics
from robot_stack.core.point_cloud import points_from_xyz
from robot_stack.ros.conversions import time_from_s, time_to_s
from robot_stack.ros.point_cloud import cloud_message
from tests.support.peer import Peer
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for

DIRECTIONS = 360
WALL = np.array([[2.0, y, z] for y in np.arange(-1.0, 1.0, 0.02) for z in (0.2, 0.5, 1.0)], np.float32)


class World:
    """A robot at the origin before a wall at x = 2 m, in 20 clouds a second. ``sent``: when each left, by its stamp."""

    def __init__(self, peer: Peer) -> None:
        self.peer = peer
        self.frame = "base_link"
        self.age_s = 0.02
        self.sent: dict[float, float] = {}
        peer.repeat(topics.ODOM, self._odometry, 50.0)
        peer.repeat(topics.OBSTACLES, self._obstacles, 20.0)
        peer.repeat(topics.FREE_SPACE, self._free_space, 20.0)

    def _odometry(self) -> Odometry:
        message = Odometry()
        message.header.stamp = time_from_s(time.time())
        message.pose.pose.orientation.w = 1.0
        return message

    def _obstacles(self) -> PointCloud2:
        message = cloud_message(points_from_xyz(WALL), self.frame)
        message.header.stamp = time_from_s(time.time() - self.age_s)
        self.sent[time_to_s(message.header.stamp)] = time.monotonic()
        return message

    def _free_space(self) -> LaserScan:
        step = 2.0 * math.pi / DIRECTIONS
        message = LaserScan(angle_min=-math.pi + 0.5 * step, angle_max=math.pi - 0.5 * step, angle_increment=step)
        message.header.stamp = time_from_s(time.time())
        message.ranges = np.full(DIRECTIONS, 1.9, np.float32)
        return message


@pytest.fixture
def world(start: Callable[..., NodeProcess], peer: Peer) -> World:
    start("costmap_server")
    return World(peer)


def _value(message: Any, x_m: float, y_m: float) -> int:
    origin = message.info.origin.position
    column = math.floor((x_m - origin.x) / message.info.resolution + 1e-6)
    row = math.floor((y_m - origin.y) / message.info.resolution + 1e-6)
    return int(message.data[row * message.info.width + column])


def test_the_grid_follows_the_clouds_and_the_passenger(world: World) -> None:
    heard = world.peer.listen(topics.LOCAL_COSTMAP)
    heard.wait(lambda _: len(heard.items) > 10, "ten grids", 60.0)
    message = heard.last
    assert message.header.frame_id == "odom"
    assert (message.info.width, message.info.height) == (200, 200)
    assert message.info.resolution == pytest.approx(0.05)
    assert (message.info.origin.position.x, message.info.origin.position.y) == (-5.0, -5.0)
    assert len(message.data) == 40000
    assert _value(message, 2.02, 0.0) == 100
    assert _value(message, 1.8, 0.0) == 99
    assert _value(message, 0.0, 0.0) == 0
    assert _value(message, 4.0, 4.0) == -1
    stamps = [time_to_s(item.header.stamp) for item in heard.messages]
    assert all(any(abs(stamp - sent) < 1e-6 for sent in world.sent) for stamp in stamps)  # a cloud's own stamps
    # 5 Hz in the clouds' own time, whatever the machine does
    assert (stamps[-1] - stamps[0]) / (len(stamps) - 1) == pytest.approx(0.2, abs=0.04)
    delays_s = sorted(
        at_s - min(world.sent.items(), key=lambda item: abs(item[0] - time_to_s(message.header.stamp)))[1]
        for at_s, message in heard.items
    )
    print(f"cloud to grid: median {1e3 * delays_s[len(delays_s) // 2]:.1f} ms")
    assert delays_s[len(delays_s) // 2] < 0.05  # at once with its cloud, not with a timer of its own

    world.peer.wait_matched(topics.PASSENGER_ATTACHED)
    assert 0 < _value(message, 2.0 - 0.385, 0.0) < 99
    world.peer.publish(topics.PASSENGER_ATTACHED, Bool(data=True))
    heard.wait(lambda message: _value(message, 2.0 - 0.385, 0.0) == 99, "the chair's inflation")


def test_it_publishes_nothing_without_good_inputs_and_says_why(world: World) -> None:
    heard = world.peer.listen(topics.LOCAL_COSTMAP)
    said: list[str] = []
    world.peer.listen(topics.DIAGNOSTICS, lambda message: said.extend(_texts(message)))
    heard.wait(lambda _: True, "a grid", 60.0)

    def silent(expected: str) -> None:
        said.clear()
        wait_for(lambda: any(expected in text for text in said), expected, 30.0)
        count = len(heard.items)
        said.clear()
        wait_for(lambda: said, "the next word")
        assert len(heard.items) == count

    def goes_on() -> None:
        count = len(heard.items)
        wait_for(lambda: len(heard.items) > count, "the next grid")

    world.age_s = 1.0
    silent("obstacles refused: they are 1.0")
    world.age_s = 0.0
    goes_on()
    world.frame = "map"
    silent("obstacles refused: frame_id is 'map', must be 'base_link'")
    world.frame = "base_link"
    goes_on()
    world.peer.silence(topics.ODOM)
    silent("waiting for /odom")
    world.peer.silence(topics.OBSTACLES)
    silent("waiting for /odom, /perception/obstacles")


def _texts(message: Any) -> list[str]:
    return [status.message for status in message.status if "costmap_server" in status.name]
