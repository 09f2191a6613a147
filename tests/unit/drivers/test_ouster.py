"""An Ouster sensor byte by byte: metadata, packets, geometry, and excerpts of recordings as ouster-sdk reads them."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from robot_stack.core.config import ConfigError
from robot_stack.core.point_cloud import SWEEP, xyz_of
from robot_stack.drivers.ouster.frame import Frame
from robot_stack.drivers.ouster.geometry import geometry_of, to_sensor
from robot_stack.drivers.ouster.layouts import layout_of
from robot_stack.drivers.ouster.metadata import parse
from robot_stack.drivers.ouster.packets import OtherSensor, Packet, PacketRefused, read
from robot_stack.drivers.ouster.points import Limits, points_of
from tests.support.ouster_packets import COLUMNS_PER_PACKET, DUAL, LEGACY, LOW_RATE, PROFILES, SINGLE, TICKS, Os

RECORDINGS = Path(__file__).parent / "data" / "ouster"
EVERYTHING = Limits(1, 1 << 20, 1e-3)


def decoded(data: bytes, device: Os, **changes: object) -> Packet:
    metadata = parse(device.metadata(**changes), "here")
    return read(data, layout_of(metadata, "here"), metadata)


def stepped(frame: int, column: int, beam: int) -> tuple[int, int]:
    """Returns a range that encodes beam and column in steps of 8 mm. Every seventh beam returns nothing."""
    return (0, 0) if beam % 7 == 3 else (8 * (200 + 16 * beam + column % 16), (beam + column) % 256)


# --- metadata ---------------------------------------------------------------------------------------------------------


def test_nested_and_flat_metadata_are_equal() -> None:
    device = Os(profile=LOW_RATE, window=(370, 85))
    metadata = parse(device.metadata(), "here")
    assert metadata == parse(device.flat_metadata(), "there")
    assert metadata.describe() == "OS-1-32 122201000998, 512x10, RNG15_RFL8_NIR8"
    assert (metadata.window, metadata.period_s, metadata.beam_origin_mm()) == ((370, 85), 0.1, (15.806, 0.0))


def test_missing_metadata_of_old_firmware_uses_defaults() -> None:
    lacking = {"udp_profile_lidar": None, "column_window": None, "beam_to_lidar_transform": None}
    metadata = parse(Os(profile=LEGACY).metadata(**lacking), "here")
    assert layout_of(metadata, "here").legacy
    assert (metadata.window, metadata.beam_origin_mm()) == ((0, 511), (15.806, 0.0))


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"prod_sn": "abc"}, "prod_sn"),
        ({"prod_sn": None}, "prod_sn: is missing"),
        ({"beam_altitude_angles": [1.0, 2.0]}, "beam_altitude_angles has 2 values for 32 pixels_per_column"),
        ({"beam_azimuth_angles": [float("nan")] * 32}, "beam_azimuth_angles"),
        ({"pixel_shift_by_row": []}, "pixel_shift_by_row has 0 values"),
        ({"columns_per_packet": 24}, "columns_per_frame must be a multiple of columns_per_packet"),
        ({"lidar_mode": "1024x10"}, "lidar_mode 1024x10 has other columns than 512"),
        ({"lidar_mode": "fast"}, "lidar_mode"),
        ({"column_window": [0, 512]}, "column_window ends beyond the 512 columns"),
        ({"column_window": [-1, 5]}, "column_window"),
        ({"lidar_to_sensor_transform": [1.0] * 16}, "lidar_to_sensor_transform must be a rotation"),
        ({"lidar_to_sensor_transform": np.diag([1.0, 1.0, -1.0, 1.0]).ravel().tolist()}, "must be a rotation"),
        ({"lidar_to_sensor_transform": [0.0] * 9}, "lidar_to_sensor_transform"),
    ],
)
def test_metadata_that_do_not_fit_together_are_refused_by_name(changes: dict[str, object], what: str) -> None:
    with pytest.raises(ConfigError, match=what):
        parse(Os().metadata(**changes), "here")


def test_malformed_metadata_is_rejected() -> None:
    for text, what in (("{", "here: not valid JSON"), ("[1]", "must be an object, is a list"), ("[" * 9999, "JSON")):
        with pytest.raises(ConfigError, match=what):
            parse(text, "here")


def test_profiles_and_headers_that_are_not_read_are_refused_by_name() -> None:
    metadata = parse(Os().metadata(udp_profile_lidar="RNG15_RFL8_WIN8"), "here")
    with pytest.raises(ConfigError, match="here: udp_profile_lidar is RNG15_RFL8_WIN8, expected one of LEGACY, RNG19"):
        layout_of(metadata, "here")
    text = json.loads(Os().metadata())
    text["lidar_data_format"]["header_type"] = "FUSA"
    with pytest.raises(ConfigError, match="header_type"):
        parse(json.dumps(text), "here")


# --- packets ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("profile", PROFILES)
def test_a_packet_is_read(profile: str) -> None:
    device = Os(stepped, profile, window=(0, 20))
    packet = decoded(device.packet(3, 16), device)
    assert (packet.frame, packet.first) == (103, 16)
    assert packet.initialization == (None if profile == LEGACY else 7_109_750)
    assert packet.valid.tolist() == [True] * 5 + [False] * 11
    assert packet.times_ns.tolist() == [device.time_ns(3, 16 + i) for i in range(COLUMNS_PER_PACKET)]
    frame = frame_of(device, [packet])
    step_mm = 8 if profile == LOW_RATE else 1
    for column in range(16, 21):
        seen = [stepped(3, column, beam) for beam in range(device.beams)]
        assert (step_mm * frame.steps[column]).tolist() == [mm for mm, _ in seen]
        assert frame.reflectivity[column].tolist() == [reflectivity for _, reflectivity in seen]


def test_reflectivity_of_old_firmware_goes_to_65535_and_is_clipped() -> None:
    device = Os(lambda frame, column, beam: (5000, 40_000 if beam else 200), LEGACY)
    frame = frame_of(device, [decoded(device.packet(0, 0), device)])
    assert frame.reflectivity[0, :3].tolist() == [200, 255, 255]


def test_the_highest_bits_of_a_range_are_of_it_and_no_more() -> None:
    for profile, mm in ((LEGACY, 0xFFFFF), (SINGLE, 0x7FFFF), (DUAL, 0x7FFFF), (LOW_RATE, 0x7FFF * 8)):
        device = Os(lambda frame, column, beam, mm=mm: (mm, 255), profile)
        frame = frame_of(device, [decoded(device.packet(0, 0), device)])
        assert frame.steps[0, 0] == (mm // 8 if profile == LOW_RATE else mm)


def changed(data: bytes, place: int, new: bytes) -> bytes:
    return data[:place] + new + data[place + len(new) :]


COLUMN = 12 + 32 * 12  # bytes per column, SINGLE with 32 beams


@pytest.mark.parametrize(
    ("place", "new", "what"),
    [
        (0, b"\x02\x00", "the packet is of type 0x0002, expected 0x0001"),
        (32 + 8, b"\x08\x00", r"a packet's columns are 8 to 15, expected 16 from a multiple of 16 on"),
        (32 + 3 * COLUMN + 8, b"\x00\x00", "a packet's columns are 0 to 15, expected 16"),
        (32, b"\xff" * 8, "a packet's columns lie from 18446744073709551615 to"),
        (32, b"\x00" * 8, "expected rising times within 6250000 ns"),
    ],
)
def test_what_is_no_packet_is_refused_by_name(place: int, new: bytes, what: str) -> None:
    device = Os()
    with pytest.raises(PacketRefused, match=what) as refusal:
        decoded(changed(device.packet(0, 0), place, new), device)
    assert not isinstance(refusal.value, OtherSensor)


def test_a_packet_of_a_wrong_size_is_refused_by_name() -> None:
    for size in (0, 1, 48, 6399, 9000, 65535):
        with pytest.raises(PacketRefused, match=f"a packet has {size} bytes, expected 6400: {SINGLE} of 32 beams"):
            decoded(bytes(size), Os())


def test_packets_of_another_sensor_than_the_metadata_describe_are_refused_by_name() -> None:
    ours = Os()
    for theirs, what in (
        (
            Os(profile=DUAL),
            f"a packet has 8448 bytes, as those in {DUAL} of 32 beams or {LOW_RATE} of 128 beams; expected 6400",
        ),
        (Os(beams=64), rf"a packet has 12544 bytes, as those in {SINGLE} of 64 beams; expected 6400"),
        (Os(serial=992_101_000_280), "serial number is 992101000280, expected 122201000998 by the metadata"),
        (Os(columns=1024), "a packet begins at column 1008, expected one of 512"),
    ):
        last = theirs.columns - COLUMNS_PER_PACKET
        with pytest.raises(OtherSensor, match=what):
            decoded(theirs.packet(0, last), ours)
    with pytest.raises(OtherSensor, match="column 32 is measured, expected 100 to 20 by the metadata's column_window"):
        decoded(ours.packet(0, 32), Os(window=(100, 20)))


def test_legacy_packet_of_other_mode_is_detected_by_encoder() -> None:
    ours, theirs = Os(profile=LEGACY), Os(profile=LEGACY, columns=1024)
    with pytest.raises(OtherSensor, match="column 48 lies at encoder tick 4224, expected 8448: 512 columns of a turn"):
        decoded(theirs.packet(0, 48), ours)
    a_tick_before = changed(ours.packet(0, 0), 12, struct.pack("<I", TICKS - 1))
    assert decoded(a_tick_before, ours).valid.all()


def test_legacy_packets_of_two_frames_are_refused() -> None:
    device = Os(profile=LEGACY)
    data = changed(device.packet(0, 0), 10, struct.pack("<H", 7))
    with pytest.raises(PacketRefused, match="a packet's columns are of frames 7 and 100, expected one"):
        decoded(data, device)


# --- geometry ---------------------------------------------------------------------------------------------------------


def frame_of(device: Os, packets: list[Packet]) -> Frame:
    metadata = parse(device.metadata(), "here")
    frame = Frame(metadata, layout_of(metadata, "here"))
    for packet in packets:
        frame.add(packet)
    return frame


def test_points_lie_where_the_manuals_formula_has_them() -> None:
    device = Os(stepped, beams=8)
    metadata = parse(device.metadata(), "here")
    packets = [decoded(data, device) for data in device.packets(device.packets_per_frame)]
    frame = frame_of(device, packets)
    points, newest_ns = points_of(frame, geometry_of(metadata, np.eye(3)), EVERYTHING)
    assert points.dtype == SWEEP
    assert newest_ns == device.time_ns(0, 511)
    expected = []
    for column in range(device.columns):
        encoder = 2.0 * np.pi * (1.0 - column / device.columns)
        for beam in range(device.beams):
            mm, reflectivity = stepped(0, column, beam)
            azimuth, altitude = -np.radians(device.azimuth_deg(beam)), np.radians(device.altitude_deg(beam))
            if mm:
                x = (mm - 15.806) * np.cos(encoder + azimuth) * np.cos(altitude) + 15.806 * np.cos(encoder)
                y = (mm - 15.806) * np.sin(encoder + azimuth) * np.cos(altitude) + 15.806 * np.sin(encoder)
                z = (mm - 15.806) * np.sin(altitude)
                seconds = 1e-9 * (device.time_ns(0, column) - newest_ns)
                expected.append((x / 1e3, y / 1e3, z / 1e3, reflectivity, device.beams - 1 - beam, seconds))
    wanted = np.array(expected)
    assert np.allclose(xyz_of(points), wanted[:, :3], atol=1e-5)
    assert np.array_equal(points["intensity"], wanted[:, 3])
    assert np.array_equal(points["ring"], wanted[:, 4])
    assert np.allclose(points["time"], wanted[:, 5], atol=1e-8)


def test_a_beam_that_begins_above_the_origin() -> None:
    """An OS-Dome, by hand: encoder 0 is straight ahead; 50 mm of the range of 5 m lie before the beam's origin."""
    device = Os(lambda frame, column, beam: (5000, 1))
    lifted = [1, 0, 0, 30, 0, 1, 0, 0, 0, 0, 1, 40, 0, 0, 0, 1]
    flat = {"beam_altitude_angles": [0.0] * 32, "beam_azimuth_angles": [0.0] * 32}
    metadata = parse(device.metadata(beam_to_lidar_transform=lifted, **flat), "here")
    frame = frame_of(device, [decoded(device.packet(0, 0), device)])
    points, _ = points_of(frame, geometry_of(metadata, np.eye(3)), EVERYTHING)
    assert np.allclose(xyz_of(points)[0], (4.95 + 0.03, 0.0, 0.04), atol=1e-6)


def test_points_exclude_ranges_beyond_limits_and_unmeasured_columns() -> None:
    ranges = {0: 999, 1: 1000, 2: 2000, 3: 2001}
    device = Os(lambda frame, column, beam: (ranges.get(beam, 0), 1), window=(0, 9))
    metadata = parse(device.metadata(), "here")
    data = changed(device.packet(0, 0), 32 + 15 * COLUMN + 12, struct.pack("<I", 1500))  # a range with status 0
    frame = frame_of(device, [decoded(data, device)])
    points, newest_ns = points_of(frame, geometry_of(metadata, np.eye(3)), Limits(1000, 2000, 1e-3))
    assert len(points) == 2 * 10
    assert set(points["ring"]) == {29, 30}
    assert newest_ns == device.time_ns(0, 9)
    frame.begin()
    with pytest.raises(ValueError, match="no column"):
        points_of(frame, geometry_of(metadata, np.eye(3)), EVERYTHING)


# --- recordings -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", sorted(RECORDINGS.glob("*.npz")), ids=lambda path: path.stem)
def test_recorded_packets_are_read_as_by_the_vendors_library(path: Path) -> None:
    recorded = np.load(path)
    metadata = parse(recorded["metadata"].tobytes().decode(), path.name)
    layout = layout_of(metadata, path.name)
    turned, moved_m = to_sensor(metadata)
    step_mm = layout.pixel.step_mm
    for i, data in enumerate(recorded["packets"]):
        frame = Frame(metadata, layout)
        packet = read(data.tobytes(), layout, metadata)
        frame.add(packet)
        places = recorded["measurements"][i]
        assert packet.valid.all()
        assert np.array_equal(packet.first + np.arange(len(places)), places)
        assert np.array_equal(packet.times_ns, recorded["times_ns"][i])
        assert np.array_equal(frame.steps[places] * step_mm, recorded["ranges_mm"][i])
        assert np.array_equal(frame.reflectivity[places], recorded["reflectivity"][i])
        points, _ = points_of(frame, geometry_of(metadata, turned), Limits(1, 1 << 20, 1e-3 * step_mm))
        seen = recorded["ranges_mm"][i] > 0
        assert len(points) == seen.sum() > 400
        off_m = np.abs(xyz_of(points) + moved_m - recorded["xyz_m"][i][seen])
        assert off_m.max() < 2e-5, "float32 at 200 m"
