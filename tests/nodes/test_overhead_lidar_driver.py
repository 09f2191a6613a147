"""The process overhead_lidar_driver: frames of the surroundings and of the robot itself, mounting, faults."""

from __future__ import annotations

import math

import numpy as np
import pytest

from custom_msgs.srv import InjectFault
from robot_stack.contract import frames, services, topics
from robot_stack.core.point_cloud import SWEEP, xyz_of
from robot_stack.core.robot import load_robot
from robot_stack.middleware.conversions import time_to_s
from robot_stack.middleware.point_cloud import points_of
from tests.nodes.test_lidar_driver import Clock, slow
from tests.support.peer import Peer, Received
from tests.support.processes import Start
from tests.support.waiting import wait_for

SENSOR = load_robot().range_sensors[frames.OVERHEAD_LIDAR]


def inject(peer: Peer, kind: str, value: float = 0.0) -> InjectFault.Response:
    request = InjectFault.Request(kind=kind, value=value, duration_s=0.0)
    return peer.call(services.INJECT_OVERHEAD_LIDAR_FAULT, request)


def in_base(message: object) -> np.ndarray:
    """(n, 3) in base_link, by the nominal mounting."""
    return xyz_of(points_of(message, SWEEP)) @ SENSOR.rotation().T + SENSOR.xyz_m


@pytest.fixture
def sweeps(start: Start, peer: Peer) -> Received:
    process = start("overhead_lidar_driver", "-p", "world:=yard")
    received = peer.listen(topics.OVERHEAD_LIDAR_POINTS)
    peer.repeat(topics.SIM_BODIES, Clock(peer).bodies, 50.0)
    wait_for(lambda: received.items or not process.running(), "a frame", deadline_s=90.0)  # the first run compiles
    assert process.running(), process.output()
    return received


def test_frames_show_ground_person_and_robot_where_they_are(sweeps: Received, peer: Peer) -> None:
    mountings = peer.listen(topics.TF_STATIC)
    wait_for(lambda: len(sweeps.items) >= 4 and mountings.items, "frames")
    message = sweeps.last
    assert (message.header.frame_id, message.point_step) == (frames.OVERHEAD_LIDAR, 24)
    points = in_base(message)
    assert 0.5 * SENSOR.rings * SENSOR.columns < len(points) <= SENSOR.rings * SENSOR.columns
    away = np.hypot(points[:, 0] - SENSOR.xyz_m[0], points[:, 1])
    ring = points[(away > 1.4) & (away < 2.4) & (points[:, 0] < 2.0)]
    assert np.abs(np.median(ring[:, 2])) < 0.02, "the ground below it is where the wheels stand"
    person = points[(np.abs(points[:, 1]) < 0.25) & (np.abs(points[:, 0] - 3.0) < 0.3) & (points[:, 2] > 0.3)]
    assert len(person) > 20, "somebody stands 3 m ahead"
    mast = points[(np.abs(points[:, 0] + 0.42) < 0.08) & (np.abs(points[:, 1]) < 0.1)]
    assert np.ptp(mast[:, 2]) > 0.5, "it sees the mast that carries it"
    stamps = np.array([time_to_s(item.header.stamp) for item in sweeps.messages])
    assert np.median(np.diff(stamps)) == pytest.approx(SENSOR.period_s, abs=1e-3)
    pose = next(t for m in mountings.messages for t in m.transforms if t.child_frame_id == frames.OVERHEAD_LIDAR)
    assert pose.transform.translation.z == pytest.approx(SENSOR.xyz_m[2])
    q = pose.transform.rotation
    assert (abs(q.x), q.y, q.z, q.w) == pytest.approx((1.0, 0.0, 0.0, 0.0), abs=1e-9)


def test_faults_change_the_frames(sweeps: Received, peer: Peer) -> None:
    assert inject(peer, "covered").success
    sweeps.wait(lambda message: _farthest(message) < 0.5, "a covered lens")
    assert inject(peer, "clear").success
    sweeps.wait(lambda message: _farthest(message) > 5.0, "a clear view")
    assert inject(peer, "frozen").success
    count = len(sweeps.items)
    wait_for(lambda: len(sweeps.items) >= count + 3, "frozen frames")
    assert bytes(sweeps.messages[-1].data) == bytes(sweeps.messages[-2].data)
    assert inject(peer, "clear").success
    assert inject(peer, "rate", 2.0).success
    wait_for(lambda: slow(sweeps), "slow frames")
    assert inject(peer, "clear").success
    assert inject(peer, "silent").success
    assert not inject(peer, "glare").success
    assert inject(peer, "clear").message == "cleared silent"


def _farthest(message: object) -> float:
    ranges = np.linalg.norm(xyz_of(points_of(message, SWEEP)), axis=1)
    return float(ranges.max()) if len(ranges) else math.nan
