"""The Xsens unit byte by byte: frames, partial frames, garbage, packets, and the resulting samples."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.config import load
from robot_stack.drivers.counters import Counters
from robot_stack.drivers.xsens.mtdata2 import MeasurementRefused, measurement
from robot_stack.drivers.xsens.params import XsensDriverParams
from robot_stack.drivers.xsens.unit import CLIPPED, DOUBLED, JUMPS, LOST, REFUSED, START, Unit
from robot_stack.drivers.xsens.xbus import CORRUPT, SKIPPED, Decoder, Message, encode
from sim.devices.xsens import Motion, Mti, frame, packet

NOW_S = 1_795_000_000.0
# By hand from the protocol: MTData2 with SampleTimeFine 10,000 only; FF + 36 + 07 + 10 + 60 + 04 + 27 + 10 = 0x1E7.
BY_HAND = bytes.fromhex("FA FF 36 07 10 60 04 00 00 27 10 19")
TIME = packet(0x1060, ">I", 10_000)
LEVEL = packet(0x2010, ">4f", 1.0, 0.0, 0.0, 0.0)
FORCE = packet(0x4020, ">3f", 0.0, 0.0, 9.81)
RATE = packet(0x8020, ">3f", 0.0, 0.0, 0.5)
WHOLE = TIME + LEVEL + FORCE + RATE


def params(**changes: object) -> XsensDriverParams:
    return load(XsensDriverParams, "xsens_driver", changes)


def decoder() -> tuple[Decoder, Counters]:
    counters = Counters()
    return Decoder(counters), counters


# --- frames ----------------------------------------------------------------------------------------------------------


def test_a_frame_made_by_hand_is_read_and_made() -> None:
    message = Message(0x36, bytes.fromhex("10 60 04 00 00 27 10"))
    assert decoder()[0].feed(BY_HAND) == [message]
    assert encode(message) == BY_HAND
    assert bytes.fromhex("FA FF 10 00 F1") == START


def test_frames_come_in_pieces() -> None:
    line, counters = decoder()
    found = [message for i in range(3 * len(BY_HAND)) for message in line.feed((BY_HAND * 3)[i : i + 1])]
    assert len(found) == 3
    assert (counters[CORRUPT], counters[SKIPPED]) == (0, 0)


@given(st.lists(st.binary(max_size=60), max_size=6), st.integers(1, 40))
def test_whatever_stands_between_frames_they_are_found(garbage: list[bytes], step: int) -> None:
    """A false start in the garbage can swallow one frame within its length; the frames after it are found."""
    line, _ = decoder()
    stream = b"".join(piece.replace(b"\xfa", b"\x00") + BY_HAND for piece in garbage)
    found = [message for i in range(0, len(stream), step) for message in line.feed(stream[i : i + step])]
    assert len(found) == len(garbage)


@given(st.binary(max_size=400))
def test_any_bytes_are_survived(data: bytes) -> None:
    line, _ = decoder()
    line.feed(data)
    assert line.feed(bytes(2100) + BY_HAND)[-1].data == BY_HAND[4:-1]


def test_each_wrong_byte_makes_a_frame_corrupt_and_the_next_is_found() -> None:
    for place in range(1, len(BY_HAND)):
        line, counters = decoder()
        wrong = bytearray(BY_HAND)
        wrong[place] ^= 0x08
        found = line.feed(bytes(wrong) + BY_HAND * 3)
        assert BY_HAND[4:-1] in [message.data for message in found]
        assert counters[CORRUPT] + counters[SKIPPED] > 0
        assert all(message.data == BY_HAND[4:-1] for message in found)


def test_long_frames() -> None:
    for size in (0, 254, 255, 256, 2048):
        message = Message(0x36, bytes(i % 251 for i in range(size)))
        line, counters = decoder()
        data = encode(message)
        assert line.feed(data[:-1]) == []
        assert line.feed(data[-1:]) == [message]
        assert data[3] == min(size, 255)
        line.feed(data[:4])
        line.restart()
        assert line.feed(data) == [message], "a restart of the line discards a partial frame"
        assert counters[CORRUPT] == 0


def test_too_much_for_a_frame() -> None:
    with pytest.raises(ValueError, match="2049 bytes do not fit"):
        encode(Message(0x36, bytes(2049)))
    line, counters = decoder()
    assert line.feed(bytes([0xFA, 0xFF, 0x36, 0xFF, 0xFF, 0xFF]) + BY_HAND) == [Message(0x36, BY_HAND[4:-1])]
    assert counters[SKIPPED] == 6


# --- packets ---------------------------------------------------------------------------------------------------------


def test_every_packet_is_read() -> None:
    data = packet(0x1020, ">H", 513) + WHOLE + packet(0xE020, ">I", 1 << 19)
    found = measurement(data)
    assert (found.ticks, found.counter, found.clipped, found.settled) == (10_000, 513, True, False)
    assert found.orientation_wxyz == (1.0, 0.0, 0.0, 0.0)
    assert found.acceleration_mps2 == pytest.approx((0.0, 0.0, 9.81))
    assert found.rotation_radps == (0.0, 0.0, 0.5)
    without = measurement(packet(0xC020, ">3f", 1.0, 0.0, 0.0) + WHOLE)  # a magnetic field, which is not used
    assert (without.counter, without.clipped, without.settled) == (None, False, True)


@pytest.mark.parametrize(
    ("number", "data"),
    [
        (0x4020, struct.pack(">3f", -1.5, 0.25, 9.75)),
        (0x4021, struct.pack(">3i", -1572864, 262144, 10223616)),
        (0x4022, b"".join(struct.pack(">Ih", *item) for item in ((1 << 31, -2), (1 << 30, 0), (3 << 30, 9)))),
        (0x4023, struct.pack(">3d", -1.5, 0.25, 9.75)),
    ],
)
def test_every_precision_is_read(number: int, data: bytes) -> None:
    packets = TIME + LEVEL + struct.pack(">HB", number, len(data)) + data + RATE
    assert measurement(packets).acceleration_mps2 == (-1.5, 0.25, 9.75)


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (b"", r"MTData2 has nothing, expected also SampleTimeFine \(0x1060\), Quaternion .*: set the unit's outputs"),
        (TIME + LEVEL + FORCE, r"has 0x1060, 0x2010, 0x4020, expected also RateOfTurn \(0x8020\)"),
        (WHOLE[:-1], "MTData2 of 55 bytes ends within the packet at byte 41"),
        (WHOLE + b"\x10", "MTData2 of 57 bytes ends within the packet at byte 56"),
        (TIME + packet(0x2014, ">4f", 1.0, 0.0, 0.0, 0.0) + FORCE + RATE, "orientation is NED, expected ENU"),
        (TIME + packet(0x2010, ">4f", 0.5, 0.0, 0.0, 0.0) + FORCE + RATE, r"quaternion's length is 0\.500, expected 1"),
        (TIME + packet(0x2010, ">3f", 1.0, 0.0, 0.0) + FORCE + RATE, "packet 0x2010 has 3 numbers, expected 4"),
        (TIME + LEVEL + packet(0x4020, ">3f", math.nan, 0.0, 0.0) + RATE, "packet 0x4020 is not finite"),
        (TIME + LEVEL + packet(0x4020, ">6H", *range(6)) + packet(0x8020, ">3H", 0, 0, 0), "6 bytes, expected a"),
        (packet(0x1060, ">H", 1) + LEVEL + FORCE + RATE, "packet 0x1060 has 2 bytes, expected 4"),
    ],
)  # fmt: skip
def test_unusable_measurement_is_rejected_with_reason(data: bytes, what: str) -> None:
    with pytest.raises(MeasurementRefused, match=what):
        measurement(data)


# --- the unit --------------------------------------------------------------------------------------------------------


def test_samples_are_stamped_by_the_units_clock_and_counted() -> None:
    unit, device = Unit(params(latency_s=0.0)), Mti(ticks=2**32 - 50)
    frames = [device.sample(Motion()) for _ in range(10)]
    # The fourth is lost, the sixth sent twice, the eighth corrupt.
    sent = {i: frames[i] for i in range(10) if i != 3}
    sent[7] = sent[7][:-1] + bytes([sent[7][-1] ^ 1])
    samples = []
    for i, data in sent.items():
        late_s = 0.02 if i % 2 else 0.0
        for piece in (data, data) if i == 5 else (data,):
            samples += unit.received(piece, NOW_S + 0.01 * i + late_s)
    stamps = [sample.stamp_s - NOW_S for sample in samples]
    assert stamps == pytest.approx([0.0, 0.01, 0.02, 0.04, 0.05, 0.06, 0.08, 0.09], abs=1e-5)
    assert (unit.counters[LOST], unit.counters[DOUBLED], unit.counters[CORRUPT]) == (2, 1, 1)
    assert unit.settled


def test_the_units_axes_become_the_robots() -> None:
    """The unit is rotated by 90 deg about z: its x points left. The robot is level and heads along the unit's -y."""
    unit = Unit(params(rpy_deg=[0.0, 0.0, 90.0]))
    motion = Motion(acceleration_mps2=(1.0, 0.0, 9.81), rotation_radps=(0.1, 0.2, 0.3))
    (sample,) = unit.received(Mti().sample(motion), NOW_S)
    assert sample.acceleration_mps2 == pytest.approx((0.0, 1.0, 9.81))
    assert sample.rotation_radps == pytest.approx((-0.2, 0.1, 0.3))
    assert sample.orientation_xyzw == pytest.approx((0.0, 0.0, -math.sqrt(0.5), math.sqrt(0.5)))
    assert sample.stamp_s == pytest.approx(NOW_S - 0.007)


def test_refusals_and_errors_are_kept_until_a_sample_comes() -> None:
    unit = Unit(params())
    assert unit.received(frame(0x36, TIME), NOW_S) == []
    assert "expected also Quaternion" in unit.problem
    assert unit.counters[REFUSED] == 1
    unit.received(frame(0x42, b"\x28"), NOW_S)
    assert unit.problem == "the unit reports error 28"
    unit.received(frame(0x42, b""), NOW_S)
    assert unit.problem == "the unit reports error without a number"
    assert unit.received(frame(0x11, b""), NOW_S) == []
    unit.received(frame(0x36, WHOLE + packet(0xE020, ">I", 1 << 19)), NOW_S)
    assert (unit.problem, unit.settled, unit.counters[CLIPPED]) == ("", False, 1)


def test_a_unit_that_was_switched_off_in_between() -> None:
    unit, device = Unit(params(latency_s=0.0)), Mti(ticks=5_000_000)
    for i in range(5):
        unit.received(device.sample(Motion()), NOW_S + 0.01 * i)
    unit.received(frame(0x42, b"\x28"), NOW_S + 0.05)
    device = Mti()
    unit.opened()
    assert unit.problem == ""
    (sample,) = unit.received(device.sample(Motion()), NOW_S + 3.0)
    assert sample.stamp_s == pytest.approx(NOW_S + 3.0)
    assert (unit.counters[JUMPS], unit.counters[LOST]) == (0, 0)


def test_a_clock_that_jumps_is_counted() -> None:
    unit = Unit(params(latency_s=0.0))
    device = Mti(ticks=1_000_000)
    for i in range(5):
        unit.received(device.sample(Motion()), NOW_S + 0.01 * i)
    (sample,) = unit.received(Mti().sample(Motion()), NOW_S + 1.0)
    assert sample.stamp_s == pytest.approx(NOW_S + 1.0)
    assert unit.counters[JUMPS] == 1
