"""The costmap server as a process: a whole grid over DDS. What it publishes when: tests/simulated/nodes."""

from __future__ import annotations

from array import array
from collections.abc import Callable

import numpy as np
from nav_msgs.msg import OccupancyGrid

from robot_stack.contract import topics
from robot_stack.core.point_cloud import points_from_xyz
from robot_stack.middleware.point_cloud import cloud_message
from tests.support.peer import Peer
from tests.support.processes import NodeProcess


def test_a_grid_goes_through_over_dds(start: Callable[..., NodeProcess], peer: Peer) -> None:
    node, clock = start("costmap_server"), peer.node.get_clock()

    def space() -> OccupancyGrid:
        message = OccupancyGrid(data=array("b", bytes(40000)))
        message.header.frame_id, message.header.stamp = "odom", clock.now().to_msg()
        message.info.resolution = 0.05
        message.info.height = message.info.width = 200
        message.info.origin.orientation.w = 1.0
        return message

    peer.repeat(topics.SPACE, space, 5.0)
    peer.repeat(topics.OBSTACLES, lambda: cloud_message(points_from_xyz(np.empty((0, 3))), "base_link"), 20.0)
    peer.listen(topics.LOCAL_COSTMAP).wait(lambda message: len(message.data) == 40000, "a grid")
    node.stop()
    assert node.process.returncode == 0
