"""The driver of Ouster sensors at its port: packets by UDP as the sensor sends them, silence, a restart."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from robot_stack.contract import topics
from robot_stack.core.point_cloud import SWEEP, xyz_of
from robot_stack.middleware.conversions import time_to_s
from robot_stack.middleware.point_cloud import points_of
from tests.support.ouster_packets import COLUMNS_PER_PACKET, Os
from tests.support.peer import Peer, says
from tests.support.processes import Start
from tests.support.udp_lidar import UdpLidar
from tests.support.waiting import wait_for

NAME = "ouster_driver"
LIDAR_IP = UdpLidar.IP
DEVICE = Os(beams=16)
HEADER, COLUMN = 32, 12 + 16 * 12


def packet_of(device: Os) -> Callable[[int], bytes]:
    """The n-th packet: columns are encoded once, then only stamped."""
    turn = list(device.packets(device.packets_per_frame))

    def packet(number: int) -> bytes:
        frame, place = divmod(number, device.packets_per_frame)
        data = bytearray(turn[place])
        struct.pack_into("<H", data, 2, (device.first_frame + frame) % 65536)
        for i in range(COLUMNS_PER_PACKET):
            struct.pack_into("<Q", data, HEADER + i * COLUMN, device.time_ns(frame, COLUMNS_PER_PACKET * place + i))
        return bytes(data)

    return packet


@pytest.fixture
def lidar() -> Iterator[UdpLidar]:
    lidar = UdpLidar(packet_of(DEVICE), DEVICE.packet_s)
    yield lidar
    lidar.close()


@pytest.fixture
def metadata(tmp_path: Path) -> Path:
    path = tmp_path / "metadata.json"
    path.write_text(DEVICE.metadata())
    return path


def arguments(lidar: UdpLidar, metadata: Path) -> list[str]:
    said = (f"port:={lidar.port}", f"device_ip:={LIDAR_IP}", f"bind_address:={LIDAR_IP}", f"metadata_file:={metadata}")
    return [argument for parameter in said for argument in ("-p", parameter)]


def test_sweeps_corrupt_packets_silence_and_a_new_start(
    start: Start, peer: Peer, lidar: UdpLidar, metadata: Path
) -> None:
    sweeps, diagnostics = peer.listen(topics.LIDAR_POINTS), peer.listen(topics.DIAGNOSTICS)
    start(NAME, *arguments(lidar, metadata))
    wait_for(lambda: len(sweeps.items) >= 5, "sweeps")
    message = sweeps.last
    points = points_of(message, SWEEP)
    assert message.header.frame_id == "lidar"
    assert points["time"].max() == 0.0
    assert set(points["ring"]) == set(range(16))
    assert np.allclose(np.linalg.norm(xyz_of(points), axis=1), 10.0, atol=0.02)
    assert abs(time_to_s(message.header.stamp) - time.time()) < 30.0
    values = says(diagnostics, NAME, "sweeps arrive")
    assert values["device"].startswith("OS-1-16 122201000998, 512x10, RNG19_RFL8_SIG16_NIR16, Ouster at 127.0.0.1")
    lidar.damage(b"\x02" + lidar.packet(0)[1:], diagnostics, NAME)
    # The cable is pulled: the node reports it and does not repeat old data.
    lidar.sends = False
    says(diagnostics, NAME, f"no packets from the Ouster at {LIDAR_IP}, port {lidar.port}")
    count = len(sweeps.items)
    says(diagnostics, NAME, "no packets")
    assert len(sweeps.items) == count
    # The sensor returns like after a power loss: frame numbers and time restart.
    lidar.packet = packet_of(DEVICE.after(begin_ns=17, initialization=1, first_frame=0))
    lidar.sends = True
    wait_for(lambda: len(sweeps.items) >= count + 3, "sweeps again")
    wait_for(lambda: int(says(diagnostics, NAME, "sweeps arrive")["starts of the sensor"]) == 1, "its new start")
    stamps = np.array([time_to_s(item.header.stamp) for item in sweeps.messages])
    assert (np.diff(stamps) > 0.0).all()


def test_packets_that_the_metadata_do_not_describe_are_named(
    start: Start, peer: Peer, lidar: UdpLidar, metadata: Path
) -> None:
    sweeps, diagnostics = peer.listen(topics.LIDAR_POINTS), peer.listen(topics.DIAGNOSTICS)
    metadata.write_text(DEVICE.after(serial=5).metadata())
    start(NAME, *arguments(lidar, metadata))
    values = says(
        diagnostics, NAME, "no sweeps: the sensor's serial number is 122201000998, expected 5 by the metadata"
    )
    assert int(values["packets that differ from the metadata"]) > 0
    assert not sweeps.items


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (None, "metadata.json: cannot be read: No such file or directory; curl -o "),
        ("{}", "prod_line: is missing"),
        (Os(beams=128).metadata(), "the sensor has 128 beams, expected at most 64 (config/robot.yaml)"),
        (DEVICE.metadata(lidar_mode="512x20"), "lidar_mode is 512x20, a turn in 0.05 s, expected 0.1 s"),
        (DEVICE.metadata(udp_profile_lidar="OFF"), "udp_profile_lidar is OFF, expected one of LEGACY"),
    ],
)
def test_metadata_that_cannot_be_used_are_one_clear_line(
    start: Start, metadata: Path, text: str | None, what: str
) -> None:
    if text is None:
        metadata.unlink()
    else:
        metadata.write_text(text)
    process = start(NAME, "-p", f"metadata_file:={metadata}")
    assert process.wait() == 2
    assert what in process.output()
