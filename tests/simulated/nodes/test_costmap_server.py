"""The costmap server with a fake perception."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Bool

from custom_msgs.msg import LatchStatus
from robot_stack.contract import topics
from robot_stack.core.point_cloud import points_from_xyz
from robot_stack.middleware.conversions import time_from_s, time_to_s
from robot_stack.middleware.point_cloud import cloud_message
from tests.simulated.bench import COMPUTE_S, LATENCY_S, Bench


class World:
    """A wall at x = 2 m, published 5 times a second. ``sent``: sending time of each grid by its stamp."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.frame = "odom"
        self.age_s = 0.02
        self.cell = 0
        self.sent: dict[float, float] = {}
        self.grids, self.diagnoses = bench.listen(topics.LOCAL_COSTMAP), bench.listen(topics.DIAGNOSTICS)
        bench.start("costmap_server")
        bench.repeat(topics.SPACE, self._space, 5.0)
        bench.repeat(topics.OBSTACLES, self._obstacles, 20.0)
        bench.run(0.5)  # until the publishers are discovered

    def _obstacles(self) -> PointCloud2:
        return cloud_message(points_from_xyz(np.empty((0, 3))), "base_link")

    def _space(self) -> OccupancyGrid:
        state = np.zeros((200, 200), np.int8)
        state[80:120, 140] = 100
        state[150:, 150:] = -1
        state[0, 0] = self.cell
        message = OccupancyGrid()
        message.header.frame_id = self.frame
        message.header.stamp = time_from_s(self.bench.stamp_s() - self.age_s)
        message.info.resolution = 0.05
        message.info.height, message.info.width = state.shape
        message.info.origin.position.x = message.info.origin.position.y = -5.0
        message.info.origin.orientation.w = 1.0
        message.data = array("b", state.tobytes())
        self.sent[time_to_s(message.header.stamp)] = self.bench.now_s
        return message

    def silent(self, expected: str) -> None:
        """Checks that nothing is published and the reason is reported."""
        self.bench.run(1.2)
        begun_s = self.bench.now_s
        self.bench.run(2.0)
        texts = [one.message for message in self.diagnoses.since(begun_s) for one in message.status]
        assert texts
        assert all(expected in text for text in texts), texts
        assert self.grids.since(begun_s) == []


@pytest.fixture
def world(bench: Bench) -> World:
    return World(bench)


def _value(message: Any, x_m: float, y_m: float) -> int:
    origin = message.info.origin.position
    column = math.floor((x_m - origin.x) / message.info.resolution + 1e-6)
    row = math.floor((y_m - origin.y) / message.info.resolution + 1e-6)
    return int(message.data[row * message.info.width + column])


def test_a_grid_is_inflated_at_once_by_the_footprint_in_force(world: World) -> None:
    world.bench.run(3.0)
    message = world.grids.last
    assert message.header.frame_id == "odom"
    assert (message.info.width, message.info.height) == (200, 200)
    assert message.info.resolution == pytest.approx(0.05)
    assert (message.info.origin.position.x, message.info.origin.position.y) == (-5.0, -5.0)
    assert len(message.data) == 40000
    assert _value(message, 2.02, 0.0) == 100
    assert _value(message, 1.8, 0.0) == 99
    assert _value(message, 0.0, 0.0) == 0
    assert _value(message, 4.0, 4.0) == -1
    assert len(world.grids.items) >= 14
    for at_s, grid in world.grids.items:  # costmaps keep the grid's stamp and follow at once, without a timer
        stamp_s = time_to_s(grid.header.stamp)
        sent_s = next(sent_s for sent, sent_s in world.sent.items() if abs(sent - stamp_s) < 1e-6)
        assert at_s - sent_s <= 2.0 * (LATENCY_S + COMPUTE_S) + 1e-6
    assert 0 < _value(message, 2.0 - 0.385, 0.0) < 99
    world.bench.publish(topics.PASSENGER_ATTACHED, Bool(data=True))
    world.grids.wait(lambda message: _value(message, 2.0 - 0.385, 0.0) == 99, "the chair's inflation", 0.5)


def test_a_false_on_passenger_attached_does_not_take_the_chair_from_the_footprint(world: World) -> None:
    """Only the docking controller can end an attachment that it reports."""
    latch = LatchStatus(closed=True, attached=True)
    world.bench.repeat(topics.LATCH_STATUS, lambda: latch, 10.0)
    world.bench.run(1.0)
    world.bench.publish(topics.PASSENGER_ATTACHED, Bool(data=False))
    begun_s = world.bench.now_s + 0.5
    world.bench.run(2.0)
    assert {_value(grid, 2.0 - 0.385, 0.0) for grid in world.grids.since(begun_s)} == {99}
    latch.attached = latch.closed = False
    world.grids.wait(lambda message: _value(message, 2.0 - 0.385, 0.0) < 99, "the empty robot's inflation", 1.0)


WRONG: dict[str, Callable[[World], None]] = {
    "space refused: it is 2.0": lambda world: setattr(world, "age_s", 2.0),
    "space refused: frame_id is 'map', must be 'odom'": lambda world: setattr(world, "frame", "map"),
    "space refused: data has other cells": lambda world: setattr(world, "cell", 7),
}


def test_no_output_without_valid_input_and_the_reason_is_reported(world: World) -> None:
    for reason, spoil in WRONG.items():
        begun_s = world.bench.now_s
        world.bench.run(1.0)
        assert len(world.grids.since(begun_s)) >= 4
        spoil(world)
        world.silent(reason)
        world.age_s, world.frame, world.cell = 0.02, "odom", 0
    world.bench.run(1.0)
    world.bench.silence(topics.OBSTACLES)
    world.silent("waiting for /perception/obstacles")
    world.bench.silence(topics.SPACE)
    world.silent("waiting for /perception/obstacles, /perception/space")
