"""The costmap server behind a fake perception."""

from __future__ import annotations

import math
import time
from array import array
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Bool

from robot_stack.contract import topics
from robot_stack.core.point_cloud import points_from_xyz
from robot_stack.middleware.conversions import time_from_s, time_to_s
from robot_stack.middleware.point_cloud import cloud_message
from tests.support.peer import Peer
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for


class World:
    """A wall at x = 2 m, 5 times a second. ``sent``: when each grid left, by its stamp."""

    def __init__(self, peer: Peer) -> None:
        self.peer = peer
        self.frame = "odom"
        self.age_s = 0.02
        self.cell = 0
        self.sent: dict[float, float] = {}
        peer.repeat(topics.SPACE, self._space, 5.0)
        peer.repeat(topics.OBSTACLES, self._obstacles, 20.0)

    def _obstacles(self) -> PointCloud2:
        return cloud_message(points_from_xyz(np.empty((0, 3))), "base_link")

    def _space(self) -> OccupancyGrid:
        state = np.zeros((200, 200), np.int8)
        state[80:120, 140] = 100
        state[150:, 150:] = -1
        state[0, 0] = self.cell
        message = OccupancyGrid()
        message.header.frame_id = self.frame
        message.header.stamp = time_from_s(time.time() - self.age_s)
        message.info.resolution = 0.05
        message.info.height, message.info.width = state.shape
        message.info.origin.position.x = message.info.origin.position.y = -5.0
        message.info.origin.orientation.w = 1.0
        message.data = array("b", state.tobytes())
        self.sent[time_to_s(message.header.stamp)] = time.monotonic()
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


def test_a_grid_is_inflated_at_once_by_the_footprint_in_force(world: World) -> None:
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
    assert all(any(abs(stamp - sent) < 1e-6 for sent in world.sent) for stamp in stamps)  # a grid's own stamps
    delays_s = sorted(
        at_s - min(world.sent.items(), key=lambda item: abs(item[0] - time_to_s(message.header.stamp)))[1]
        for at_s, message in heard.items
    )
    print(f"space to costmap: median {1e3 * delays_s[len(delays_s) // 2]:.1f} ms")
    assert delays_s[len(delays_s) // 2] < 0.05  # at once, not with a timer of its own

    world.peer.wait_matched(topics.PASSENGER_ATTACHED)
    assert 0 < _value(message, 2.0 - 0.385, 0.0) < 99
    world.peer.publish(topics.PASSENGER_ATTACHED, Bool(data=True))
    heard.wait(lambda message: _value(message, 2.0 - 0.385, 0.0) == 99, "the chair's inflation")


def test_it_publishes_nothing_without_a_good_input_and_says_why(world: World) -> None:
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

    world.age_s = 2.0
    silent("space refused: it is 2.0")
    world.age_s = 0.0
    goes_on()
    world.frame = "map"
    silent("space refused: frame_id is 'map', must be 'odom'")
    world.frame = "odom"
    goes_on()
    world.cell = 7
    silent("space refused: data has other cells")
    world.cell = 0
    goes_on()
    world.peer.silence(topics.OBSTACLES)
    silent("waiting for /perception/obstacles")
    world.peer.silence(topics.SPACE)
    silent("waiting for /perception/obstacles, /perception/space")


def _texts(message: Any) -> list[str]:
    return [status.message for status in message.status if "costmap_server" in status.name]
