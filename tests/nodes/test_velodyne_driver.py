"""The driver of the VLP-16 at its port: packets by UDP as the LiDAR sends them, silence, packets of other senders."""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator

import numpy as np
import pytest

from robot_stack.contract import topics
from robot_stack.core.point_cloud import SWEEP, xyz_of
from robot_stack.middleware.conversions import time_to_s
from robot_stack.middleware.point_cloud import points_of
from tests.support.devices.velodyne import PACKET_S, Vlp16
from tests.support.peer import Peer, says
from tests.support.processes import Start
from tests.support.udp_lidar import UdpLidar
from tests.support.waiting import wait_for

NAME = "velodyne_driver"
TURN = 75  # packets of a turn that starts at azimuth 0
LIDAR_IP = UdpLidar.IP


def vlp16() -> UdpLidar:
    """Turns at 10.05 Hz."""
    device = Vlp16(lambda azimuth, elevation: (10.0, 50), turns_hz=1.0 / (TURN * PACKET_S))
    turn = [packet[:1200] for packet in device.packets(TURN)]

    def packet(number: int) -> bytes:
        microseconds = int(number * PACKET_S * 1e6) % 3_600_000_000
        return turn[number % TURN] + struct.pack("<IBB", microseconds, 0x37, 0x22)

    return UdpLidar(packet, PACKET_S)


@pytest.fixture
def lidar() -> Iterator[UdpLidar]:
    lidar = vlp16()
    yield lidar
    lidar.close()


def test_sweeps_corrupt_packets_and_silence(start: Start, peer: Peer, lidar: UdpLidar) -> None:
    sweeps, diagnostics = peer.listen(topics.LIDAR_POINTS), peer.listen(topics.DIAGNOSTICS)
    start(NAME, "-p", f"port:={lidar.port}", "-p", f"device_ip:={LIDAR_IP}", "-p", f"bind_address:={LIDAR_IP}")
    wait_for(lambda: len(sweeps.items) >= 5, "sweeps")
    message = sweeps.last
    points = points_of(message, SWEEP)
    assert message.header.frame_id == "lidar"
    assert points["time"].max() == 0.0
    assert set(points["ring"]) == set(range(16))
    assert np.allclose(np.linalg.norm(xyz_of(points), axis=1), 10.0, atol=0.05)
    assert abs(time_to_s(message.header.stamp) - time.time()) < 30.0
    values = says(diagnostics, NAME, "sweeps arrive")
    assert values["device"].startswith("VLP-16")
    lidar.damage(b"\xff\xee" + bytes(1204), diagnostics, NAME)
    # The cable is pulled, which damages the last packet: the node reports it and repeats no old data.
    lidar.sends = False
    lidar.damage(b"\xff\xee" + bytes(1204), diagnostics, NAME)
    says(diagnostics, NAME, f"no packets from the Velodyne at {LIDAR_IP}, port {lidar.port}")
    count = len(sweeps.items)
    says(diagnostics, NAME, "no packets")
    assert len(sweeps.items) == count
    lidar.sends = True
    wait_for(lambda: len(sweeps.items) >= count + 3, "sweeps again")
    stamps = np.array([time_to_s(item.header.stamp) for item in sweeps.messages])
    assert (np.diff(stamps) > 0.0).all()


def test_packets_of_others_are_not_taken(start: Start, peer: Peer, lidar: UdpLidar) -> None:
    sweeps, diagnostics = peer.listen(topics.LIDAR_POINTS), peer.listen(topics.DIAGNOSTICS)
    start(NAME, "-p", f"port:={lidar.port}", "-p", "device_ip:=192.168.1.201", "-p", f"bind_address:={LIDAR_IP}")
    values = wait_for(
        lambda: (found := says(diagnostics, NAME, "the Velodyne at 192.168.1.201"))
        and int(found["packets of others"]) > 100 and found,
        "packets of others",
    )  # fmt: skip
    assert values["device"].startswith("no packet yet")
    assert not sweeps.items


def test_foreign_bind_address_is_reported(start: Start) -> None:
    process = start(NAME, "-p", "bind_address:=192.0.2.1")
    assert process.wait() == 2
    assert "192.0.2.1 port 2368: Cannot assign requested address" in process.output()
