"""The DDS configuration: point clouds of full size arrive, and a lost reliable message is repeated at once."""

from __future__ import annotations

import contextlib
import signal
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_msgs.msg import Bool

from robot_stack.contract import topics
from tests.support.processes import Start

if TYPE_CHECKING:
    from tests.support.peer import Peer

POINTS = 150_000
POINT_BYTES = 16
CLOUDS = 50
LOST_MAX = 10
SCRIPTS = Path(__file__).parent / "scripts"
SUBSCRIBER = SCRIPTS / "cloud_counter.py"


def _cloud(sequence: int) -> PointCloud2:
    message = PointCloud2(height=1, width=POINTS, point_step=POINT_BYTES, row_step=POINT_BYTES * POINTS, is_dense=True)
    message.fields = [
        PointField(name=n, offset=4 * i, datatype=PointField.FLOAT32, count=1) for i, n in enumerate("xyzi")
    ]
    message.header.frame_id = str(sequence)
    message._data = bytes(POINT_BYTES * POINTS)  # the setter would check 2.4 million bytes one by one
    return message


def test_all_clouds_reach_three_processes(start: Start, peer: Peer) -> None:
    subscribers = [start(f"counter{i}", command=[sys.executable, str(SUBSCRIBER), str(CLOUDS)]) for i in range(3)]
    peer.wait_matched(topics.LIDAR_POINTS, 3)
    for subscriber in subscribers:
        subscriber.wait_output("connected")
    # A stalled receiver may miss a cloud, as on a robot: the topic is best effort.
    number = 0
    while any(subscriber.output().count("cloud ") < CLOUDS for subscriber in subscribers):
        number += 1
        assert number <= CLOUDS + LOST_MAX, "too many clouds are lost"
        peer.publish(topics.LIDAR_POINTS, _cloud(number))
        for subscriber in subscribers:
            with contextlib.suppress(AssertionError):
                subscriber.wait_output(f"cloud {number}\n", 2.0)
    assert [subscriber.wait() for subscriber in subscribers] == [0, 0, 0]


def test_an_emergency_stop_that_was_lost_is_repeated_at_once(start: Start, peer: Peer) -> None:
    """By default Fast DDS repeats it after 2.3 to 3 s."""
    listener = start("listener", command=[sys.executable, str(SCRIPTS / "stop_listener.py")])
    peer.wait_matched(topics.EMERGENCY_STOP)
    peer.wait_matched(topics.JOINT_STATES)
    peer.publish(topics.EMERGENCY_STOP, Bool(data=False))
    listener.wait_output("no stop\n")

    def comes_at_once(number: int) -> bool:
        listener.signal(signal.SIGSTOP)
        for _ in range(5000):  # exceeds the socket's buffer
            peer.publish(topics.JOINT_STATES, JointState())
        peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
        begun_s = time.monotonic()
        listener.signal(signal.SIGCONT)
        listener.wait_output("no stop\n" + number * "stop\n")
        return time.monotonic() < begun_s + 1.5

    # A busy machine may delay one of them.
    assert any(comes_at_once(number) for number in range(1, 6))


@pytest.mark.parametrize(("name", "shared"), [("swerve_controller", False), ("perception_pipeline", True)])
def test_only_processes_with_clouds_use_shared_memory(start: Start, peer: Peer, name: str, shared: bool) -> None:
    """A process with shared memory stalls when another program starts, so processes that stop the wheels use none."""
    process = start(name)
    peer.wait_matched(topics.EMERGENCY_STOP if name == "swerve_controller" else topics.LIDAR_POINTS)
    assert ("/dev/shm/fastrtps_" in Path(f"/proc/{process.pid}/maps").read_text()) == shared
