"""Measurements of an MTData2 message. Packets: identifier (2 bytes), size (1 byte), data; all big endian."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Final

PACKET_COUNTER: Final = 0x1020
SAMPLE_TIME_FINE: Final = 0x1060
QUATERNION: Final = 0x2010
ACCELERATION: Final = 0x4020
RATE_OF_TURN: Final = 0x8020
STATUS_WORD: Final = 0xE020
TICKS_PER_S: Final = 10_000  # of SampleTimeFine
CLIPPED: Final = 1 << 19  # of the status word: an axis measured beyond its range
FILTER_VALID: Final = 1 << 1
_NAMES: Final = {
    SAMPLE_TIME_FINE: "SampleTimeFine",
    QUATERNION: "Quaternion",
    ACCELERATION: "Acceleration",
    RATE_OF_TURN: "RateOfTurn",
}
_SYSTEMS: Final = {0x0: "ENU", 0x4: "NED", 0x8: "NWU"}
_KIND, _SYSTEM, _PRECISION = 0xFFF0, 0x000C, 0x0003
_NORM_OFF = 0.01  # of a quaternion, whose length is 1

Vector = tuple[float, float, float]


class MeasurementRefused(Exception):
    """An invalid measurement. The message is one line: what was found and what was expected."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """In the unit's frame: m/s2 with gravity, rad/s; orientation w x y z in a frame whose z is up.

    ticks: SampleTimeFine, 32 bits of 0.1 ms. counter: 16 bits; None where the unit does not send it. clipped: an axis
    has measured beyond its range. settled: the unit's orientation filter is valid; both False or True where the unit
    sends no status.
    """

    ticks: int
    counter: int | None
    orientation_wxyz: tuple[float, float, float, float]
    acceleration_mps2: Vector
    rotation_radps: Vector
    clipped: bool
    settled: bool


def measurement(data: bytes) -> Measurement:
    """The measurement in the data of an MTData2 message. Raises MeasurementRefused."""
    packets = _packets(data)
    missing = [f"{name} (0x{number:04X})" for number, name in _NAMES.items() if number not in packets]
    if missing:
        seen = ", ".join(f"0x{number:04X}" for number in packets) or "nothing"
        raise MeasurementRefused(f"MTData2 has {seen}, expected also {', '.join(missing)}: set the unit's outputs")
    w, x, y, z = _numbers(packets, QUATERNION, 4)
    if abs(math.hypot(w, x, y, z) - 1.0) > _NORM_OFF:
        raise MeasurementRefused(f"the quaternion's length is {math.hypot(w, x, y, z):.3f}, expected 1")
    ax, ay, az = _numbers(packets, ACCELERATION, 3)
    rx, ry, rz = _numbers(packets, RATE_OF_TURN, 3)
    counter = _unsigned(packets, PACKET_COUNTER, 2) if PACKET_COUNTER in packets else None
    status = _unsigned(packets, STATUS_WORD, 4) if STATUS_WORD in packets else FILTER_VALID
    return Measurement(
        _unsigned(packets, SAMPLE_TIME_FINE, 4),
        counter,
        (w, x, y, z),
        (ax, ay, az),
        (rx, ry, rz),
        clipped=bool(status & CLIPPED),
        settled=bool(status & FILTER_VALID),
    )


def _packets(data: bytes) -> dict[int, tuple[int, bytes]]:
    """Kind -> identifier with its format, data. Unknown kinds are ignored."""
    found: dict[int, tuple[int, bytes]] = {}
    at = 0
    while at < len(data):
        if at + 3 > len(data) or at + 3 + data[at + 2] > len(data):
            raise MeasurementRefused(f"MTData2 of {len(data)} bytes ends within the packet at byte {at}")
        number, size = int.from_bytes(data[at : at + 2], "big"), data[at + 2]
        found[number & _KIND] = number, data[at + 3 : at + 3 + size]
        at += 3 + size
    return found


def _unsigned(packets: dict[int, tuple[int, bytes]], kind: int, size: int) -> int:
    number, data = packets[kind]
    if len(data) != size:
        raise MeasurementRefused(f"packet 0x{number:04X} has {len(data)} bytes, expected {size}")
    return int.from_bytes(data, "big")


def _numbers(packets: dict[int, tuple[int, bytes]], kind: int, count: int) -> tuple[float, ...]:
    number, data = packets[kind]
    system = _SYSTEMS.get(number & _SYSTEM, "of an unknown frame")
    # The frame is that of orientations; NWU has z up too, but another zero of the heading, which is not used.
    if kind == QUATERNION and system not in ("ENU", "NWU"):
        raise MeasurementRefused(f"the orientation is {system}, expected ENU: set the unit's outputs")
    values = _decoded(number & _PRECISION, data, number)
    if len(values) != count:
        raise MeasurementRefused(f"packet 0x{number:04X} has {len(values)} numbers, expected {count}")
    if not all(map(math.isfinite, values)):
        raise MeasurementRefused(f"packet 0x{number:04X} is not finite")
    return values


def _decoded(precision: int, data: bytes, number: int) -> tuple[float, ...]:
    """Single, 12.20 fixed point, 16.32 fixed point (fraction first), double."""
    size = (4, 4, 6, 8)[precision]
    if len(data) % size:
        raise MeasurementRefused(f"packet 0x{number:04X} has {len(data)} bytes, expected a multiple of {size}")
    count = len(data) // size
    if precision == 0:
        return struct.unpack(f">{count}f", data)
    if precision == 1:
        return tuple(value / 2**20 for value in struct.unpack(f">{count}i", data))
    if precision == 2:
        pairs = struct.iter_unpack(">Ih", data)
        return tuple(whole + fraction / 2**32 for fraction, whole in pairs)
    return struct.unpack(f">{count}d", data)
