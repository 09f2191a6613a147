"""Point clouds of full size arrive, all of them, at three subscriber processes."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from sensor_msgs.msg import PointCloud2, PointField

from robot_stack.contract import topics
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.peer import Peer

POINTS = 150_000
POINT_BYTES = 16
CLOUDS = 50
SUBSCRIBER = Path(__file__).parent / "scripts" / "cloud_counter.py"


def _cloud(sequence: int) -> PointCloud2:
    message = PointCloud2(height=1, width=POINTS, point_step=POINT_BYTES, row_step=POINT_BYTES * POINTS, is_dense=True)
    message.fields = [
        PointField(name=n, offset=4 * i, datatype=PointField.FLOAT32, count=1) for i, n in enumerate("xyzi")
    ]
    message.header.frame_id = str(sequence)
    message._data = bytes(POINT_BYTES * POINTS)  # the setter would check 2.4 million bytes one by one
    return message


def test_all_clouds_reach_three_processes(start: Callable[..., NodeProcess], peer: Peer) -> None:
    subscribers = [start(f"counter{i}", command=[sys.executable, str(SUBSCRIBER), str(CLOUDS)]) for i in range(3)]
    peer.wait_matched(topics.LIDAR_POINTS, 3)
    for subscriber in subscribers:
        subscriber.wait_output("connected")
    sent = [0]

    def next_cloud() -> PointCloud2:
        sent[0] += 1
        return _cloud(sent[0])

    peer.repeat(topics.LIDAR_POINTS, next_cloud, topics.LIDAR_POINTS.rate_hz or 10.0)
    wait_for(lambda: sent[0] >= CLOUDS, "all clouds sent", 60.0)
    peer.silence(topics.LIDAR_POINTS)
    for subscriber in subscribers:
        subscriber.wait_output("received", 10.0)
        # The last cloud may have been sent twice at most: what counts is that none of the first is missing.
        assert f"received {CLOUDS} of the first {CLOUDS}" in subscriber.output()
