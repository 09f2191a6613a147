"""The process lidar_driver: half and full sweeps, their fields and stamps, mounting, faults."""

from __future__ import annotations

import math

import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped

from custom_msgs.srv import InjectFault
from robot_stack.contract import services, topics
from robot_stack.core.point_cloud import SWEEP, xyz_of
from robot_stack.middleware.conversions import time_to_s
from robot_stack.middleware.point_cloud import points_of
from tests.support.peer import Peer, Received
from tests.support.processes import Start
from tests.support.waiting import wait_for
from tf2_msgs.msg import TFMessage

COLUMNS = 128
BODIES = {"base_link": (10.0, 1.0, 0.0), "person_anna": (13.0, 1.0, 0.0)}


class Clock:
    """Body poses stamped 20 ms apart, independent of their sending time."""

    def __init__(self, peer: Peer) -> None:
        self._ns = peer.node.get_clock().now().nanoseconds

    def bodies(self) -> TFMessage:
        self._ns += 20_000_000
        message = TFMessage()
        for name, (x, y, yaw) in BODIES.items():
            item = TransformStamped(child_frame_id=name)
            item.header.frame_id = "map"
            item.header.stamp.sec, item.header.stamp.nanosec = divmod(self._ns, 1_000_000_000)
            item.transform.translation.x, item.transform.translation.y = x, y
            item.transform.rotation.z, item.transform.rotation.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
            message.transforms.append(item)
        return message


def inject(peer: Peer, kind: str, value: float = 0.0, target: str = "") -> InjectFault.Response:
    request = InjectFault.Request(kind=kind, target=target, value=value, duration_s=0.0)
    return peer.call(services.INJECT_LIDAR_FAULT, request)


def ranges(message: object) -> np.ndarray:
    return np.linalg.norm(xyz_of(points_of(message, SWEEP)), axis=1)


def stamps(received: Received) -> np.ndarray:
    return np.array([time_to_s(message.header.stamp) for message in received.messages])


def slow(received: Received) -> bool:
    """True if the last three messages are whole half seconds apart: lost messages are not repeated."""
    steps = np.diff(stamps(received)[-3:]) / 0.5
    return len(steps) == 2 and np.allclose(steps, np.round(steps), atol=2e-3)


@pytest.fixture
def sweeps(start: Start, peer: Peer) -> Received:
    process = start("lidar_driver", "-p", f"columns:={COLUMNS}", "-p", "world:=yard")
    received = peer.listen(topics.LIDAR_POINTS)
    peer.repeat(topics.SIM_BODIES, Clock(peer).bodies, 50.0)
    wait_for(lambda: received.items or not process.running(), "a sweep", deadline_s=90.0)  # the first run compiles
    assert process.running(), process.output()
    return received


def test_half_sweeps_make_full_sweeps_with_every_field(sweeps: Received, peer: Peer) -> None:
    halves, mountings = peer.listen(topics.LIDAR_HALF_SWEEP), peer.listen(topics.TF_STATIC)
    wait_for(lambda: len(sweeps.items) >= 6 and len(halves.items) >= 12 and mountings.items, "sweeps")
    message = sweeps.last
    assert (message.header.frame_id, message.height, message.point_step) == ("lidar", 1, 24)
    points = points_of(message, SWEEP)
    assert 0.7 * 64 * COLUMNS < len(points) <= 64 * COLUMNS
    assert points["time"].max() == pytest.approx(0.0, abs=1e-6)
    assert points["time"].min() == pytest.approx(-0.1, abs=2e-3)
    assert (np.diff(points["time"]) >= 0.0).all(), "in the order of firing"
    assert set(points["ring"]) <= set(range(64))
    assert np.isfinite(xyz_of(points)).all()
    elevation = np.degrees(np.arcsin(points["z"] / ranges(message)))
    assert np.allclose(elevation, -30.0 + points["ring"] * 45.0 / 63.0, atol=0.01)
    # A person stands 3 m before the robot, 2.8 m before the sensor.
    ahead = (abs(points["y"]) < 0.2) & (abs(points["x"] - 2.6) < 0.15) & (points["z"] > 0.2)
    assert ahead.sum() > 5
    for received, period_s in ((halves, 0.05), (sweeps, 0.1)):
        steps = np.diff(stamps(received)) / period_s
        # Whole periods: the topics are best effort, so a busy machine may lose messages.
        assert np.allclose(steps, np.round(steps), atol=2e-3)
        assert np.median(steps) == pytest.approx(1.0, abs=2e-3)
    assert set(np.round(stamps(sweeps), 4)) & set(np.round(stamps(halves), 4))
    place = next(t for m in mountings.messages for t in m.transforms if t.child_frame_id == "lidar")
    assert place.header.frame_id == "base_link"
    assert (place.transform.translation.x, place.transform.translation.z) == pytest.approx((0.20, 0.70))


def test_faults_change_the_points_and_are_answered(sweeps: Received, peer: Peer) -> None:
    assert inject(peer, "covered").success
    sweeps.wait(lambda message: len(ranges(message)) == 0 or ranges(message).max() < 0.5, "a covered lens")
    assert inject(peer, "clear").message == "cleared covered"
    sweeps.wait(lambda message: len(ranges(message)) > 0 and ranges(message).max() > 5.0, "a clear view")
    assert inject(peer, "dust", value=10.0).message == "dust is in the air, visibility in m 10"
    sweeps.wait(lambda message: len(ranges(message)) > 0 and ranges(message).max() < 14.0, "a view through dust")
    assert inject(peer, "clear").message == "cleared dust"
    sweeps.wait(lambda message: len(ranges(message)) > 0 and ranges(message).max() > 15.0, "a clear view again")
    assert inject(peer, "frozen").success
    data = bytes(sweeps.last.data)
    count = len(sweeps.items)
    wait_for(lambda: len(sweeps.items) >= count + 4, "more sweeps")
    last, before = sweeps.messages[-1], sweeps.messages[-2]
    assert bytes(last.data) == bytes(before.data), data[:24]
    assert time_to_s(last.header.stamp) > time_to_s(before.header.stamp)
    assert inject(peer, "clear", target="frozen").success
    assert inject(peer, "rate", value=2.0).success
    wait_for(lambda: slow(sweeps), "slow sweeps")
    assert inject(peer, "clear").success
    assert inject(peer, "silent").success
    wait_for(lambda: inject(peer, "clear", target="rate").message == "nothing to clear", "an answer")
    assert inject(peer, "clear").message == "cleared silent"
    count = len(sweeps.items)
    wait_for(lambda: len(sweeps.items) >= count + 3, "sweeps again")
    assert (np.diff(stamps(sweeps)) > 0.0).all()
    refused = inject(peer, "glare")
    assert not refused.success
    assert "no fault 'glare'" in refused.message
