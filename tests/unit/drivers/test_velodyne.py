"""A VLP-16 byte by byte: its packets, the resulting sweeps, and transmission faults."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from robot_stack.core.config import load
from robot_stack.core.point_cloud import SWEEP, xyz_of
from robot_stack.drivers.velodyne.packets import PacketRefused, read
from robot_stack.drivers.velodyne.params import VelodyneDriverParams
from robot_stack.drivers.velodyne.sweeps import CORRUPT, DOUBLED, INCOMPLETE, JUMPS, LOST, OUT_OF_ORDER, SweepBuilder
from tests.support.devices.velodyne import PACKET_S, Vlp16

NOW_S = 1_795_000_000.0
FLIGHT_S = 0.002  # from a packet's first firing to its arrival
TURN = 76  # packets per turn, rounded up


def room(azimuth_deg: float, elevation_deg: float) -> tuple[float, int]:
    """The distance encodes the azimuth, the reflectivity the elevation. Beyond 300 deg nothing returns."""
    return (5.0 + azimuth_deg / 100.0, 100 + round(elevation_deg)) if azimuth_deg < 300.0 else (0.0, 0)


def everywhere(azimuth_deg: float, elevation_deg: float) -> tuple[float, int]:
    return 10.0, 50


def params(**changes: object) -> VelodyneDriverParams:
    return load(VelodyneDriverParams, "velodyne_driver", {"latency_s": FLIGHT_S, **changes})


def builder(**changes: object) -> SweepBuilder:
    return SweepBuilder(params(**changes), 0.1)


def run(built: SweepBuilder, packets: list[bytes], begin_s: float = NOW_S):
    """Returns the sweeps of packets that arrive in order. None stands for a lost packet."""
    found = []
    for i, packet in enumerate(packets):
        if packet is not None:
            sweep = built.received(packet, begin_s + i * PACKET_S + FLIGHT_S)
            found += [sweep] if sweep is not None else []
    return found


# --- packets ----------------------------------------------------------------------------------------------------------


def test_a_packet_is_1206_bytes_with_its_time_at_the_end() -> None:
    (data,) = Vlp16(everywhere, hour_s=1.5).packets(1)
    assert len(data) == 1206
    assert data[:2] == b"\xff\xee"
    assert data[4:7] == struct.pack("<HB", 5000, 50)
    assert data[-6:] == struct.pack("<IBB", 1_500_000, 0x37, 0x22)
    packet = read(data)
    assert (packet.model, packet.hour_us, packet.duration_s) == ("VLP-16", 1_500_000, pytest.approx(1.327104e-3))
    assert read(data[:-2] + b"\x39\x24").duration_s == pytest.approx(0.663552e-3)


@pytest.mark.parametrize(
    ("place", "data", "what"),
    [
        (0, None, "a packet has 554 bytes, expected 1206"),
        (300, b"\xdd\xee", "block 3 begins with ddee, expected ffee"),
        (1102, b"\xa0\x8c", r"block 11 is at 360\.0 deg, expected less than 360"),
        (1205, b"\x28", "the sensor is of model 0x28, expected VLP-16 or Puck Hi-Res"),
        (1204, b"\x00", "the return mode is 0x00, expected 0x37, 0x38 or 0x39"),
        (1200, b"\xff\xff\xff\xff", "the time is 4294967295 us past the hour, expected less than 3600000000"),
    ],
)
def test_what_is_no_packet_is_refused_by_name(place: int, data: bytes | None, what: str) -> None:
    (whole,) = Vlp16(everywhere).packets(1)
    wrong = whole[:554] if data is None else whole[:place] + data + whole[place + len(data) :]
    with pytest.raises(PacketRefused, match=what):
        read(wrong)
    built = builder()
    assert built.received(wrong, NOW_S) is None
    assert built.counters[CORRUPT] == 1
    assert built.problem
    built.received(whole, NOW_S)
    assert (built.problem, built.model) == ("", "VLP-16")


# --- sweeps -----------------------------------------------------------------------------------------------------------


def test_a_turn_is_a_sweep_of_the_contract() -> None:
    sweeps = run(builder(), list(Vlp16(room).packets(5 * TURN)))
    assert len(sweeps) == 4
    for sweep in sweeps[1:]:
        points = sweep.points
        assert points.dtype == SWEEP
        assert points["time"][-1] == 0.0
        assert (np.diff(points["time"]) >= 0.0).all()
        assert set(points["ring"]) == set(range(16))
        distance = np.linalg.norm(xyz_of(points), axis=1)
        # x points ahead at azimuth 0, which the sensor counts clockwise; nothing returns beyond 300 deg.
        azimuth = -np.degrees(np.arctan2(points["y"], points["x"])) % 360.0
        assert azimuth.max() < 300.5
        assert np.allclose(distance, 5.0 + azimuth / 100.0, atol=0.01)
        # Ring 0 is the lowest; the lasers are off the centre by up to 1.2 cm in height.
        elevation = np.degrees(np.arcsin(points["z"] / distance))
        assert np.allclose(elevation, -15.0 + 2.0 * points["ring"], atol=0.2)
        assert (points["intensity"] == 100 + np.round(elevation)).mean() > 0.99


def test_stamps_are_those_of_the_newest_point() -> None:
    device = Vlp16(everywhere, hour_s=3599.9)  # the hour wraps in the second turn
    sweeps = run(builder(), list(device.packets(5 * TURN)))
    for sweep in sweeps[1:]:
        # The sensor turns clockwise at 3600 deg/s from azimuth 0 at the first firing: the azimuth gives the time.
        turned_deg = -np.degrees(np.arctan2(sweep.points["y"], sweep.points["x"])).astype(float)
        seconds = sweep.stamp_s - NOW_S + sweep.points["time"].astype(float)
        off_deg = (3600.0 * seconds - turned_deg + 180.0) % 360.0 - 180.0
        assert abs(off_deg).max() < 0.5, "0.14 ms, most of it the lasers' own places"
        assert abs(off_deg.mean()) < 0.05
        assert sweep.points["time"][0] == pytest.approx(-0.1, abs=2.5 * PACKET_S)
        assert len(sweep.points) == pytest.approx(16 * 0.1 / 55.296e-6, rel=0.03)


def test_the_lidar_may_be_turned() -> None:
    straight, turned = builder(), builder(rpy_deg=[0.0, 0.0, 90.0])
    packets = list(Vlp16(room).packets(3 * TURN))
    ours, theirs = run(turned, packets)[-1].points, run(straight, packets)[-1].points
    assert np.allclose(ours["x"], -theirs["y"], atol=1e-5)
    assert np.allclose(ours["y"], theirs["x"], atol=1e-5)


# --- transmission -----------------------------------------------------------------------------------------------------


def test_lost_doubled_and_late_packets_are_counted() -> None:
    packets: list = list(Vlp16(everywhere).packets(4 * TURN))
    built = builder()
    packets[100] = packets[101] = None  # lost
    packets[120] = packets[119]  # duplicated, in place of a third lost packet
    packets[150], packets[151] = packets[151], packets[150]  # reordered: the late packet is discarded
    sweeps = run(built, packets)
    counted = {name: built.counters[name] for name in (LOST, DOUBLED, OUT_OF_ORDER, CORRUPT, JUMPS)}
    assert counted == {LOST: 4, DOUBLED: 1, OUT_OF_ORDER: 1, CORRUPT: 0, JUMPS: 0}
    assert len(sweeps) == 3
    assert len(sweeps[2].points) - len(sweeps[1].points) > 3 * 24 * 16 - 24 * 16, "holes, not other sweeps' points"


def test_a_lidar_that_was_silent_goes_on_with_whole_sweeps() -> None:
    device = Vlp16(everywhere)
    packets = list(device.packets(6 * TURN))
    built = builder()
    run(built, packets[: TURN + 20])
    later = run(built, packets[4 * TURN :], NOW_S + 4 * TURN * PACKET_S)
    assert built.counters[LOST] == 3 * TURN - 20
    for sweep in later:
        assert sweep.points["time"][0] == pytest.approx(-0.1, abs=2.5 * PACKET_S)
    assert built.counters[INCOMPLETE] <= 2


def test_lidar_exchanged_for_the_other_model_goes_on_with_its_sweeps() -> None:
    built = builder()
    run(built, list(Vlp16(everywhere).packets(2 * TURN)))
    packets = [packet[:-1] + b"\x24" for packet in Vlp16(everywhere).packets(4 * TURN)]
    assert len(run(built, packets[2 * TURN :], NOW_S + 2 * TURN * PACKET_S)) == 1
    assert built.model == "Puck Hi-Res"


@pytest.mark.parametrize(("before_s", "after_s", "pause_s"), [(0.0, 1000.0, 0.0), (1000.0, 2.0, 19.8)])
def test_a_clock_that_jumps_counts_no_losses(before_s: float, after_s: float, pause_s: float) -> None:
    built, begin_s = builder(), NOW_S + 2 * TURN * PACKET_S + pause_s
    run(built, list(Vlp16(everywhere, hour_s=before_s).packets(2 * TURN)))
    sweeps = run(built, list(Vlp16(everywhere, hour_s=after_s).packets(3 * TURN)), begin_s)
    assert (built.counters[JUMPS], built.counters[LOST]) == (1, 0)
    assert begin_s < sweeps[-1].stamp_s < begin_s + 0.4


def test_half_turn_is_counted_incomplete() -> None:
    """The sensor turns twice as fast as config/robot.yaml specifies."""
    built = builder()
    assert run(built, list(Vlp16(everywhere, turns_hz=20.0).packets(3 * TURN))) == []
    assert built.counters[INCOMPLETE] >= 4
