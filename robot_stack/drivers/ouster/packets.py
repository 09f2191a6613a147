"""Lidar data packets as values; rejects packets that are invalid or from another sensor than the metadata's."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from robot_stack.drivers.ouster.layouts import ENCODER_TICKS, Layout, resembles
from robot_stack.drivers.ouster.metadata import Metadata

_LIDAR_DATA: Final = 1
_HEADER: Final = struct.Struct("<HH3s5s")  # type, frame, initialization, serial number
_LEGACY_VALID: Final = 0xFFFFFFFF
_SPAN: Final = 2  # times as long as a packet takes, its columns may not lie apart


class PacketRefused(Exception):
    """An invalid packet. The message is one line: what was found and what was expected."""


class OtherSensor(PacketRefused):
    """A valid packet that does not match the metadata."""


@dataclass(frozen=True, slots=True)
class Packet:
    """first: its first column's place in the frame. times_ns: (n,) of the columns, by the sensor's clock.

    valid: (n,) columns that were measured. initialization: changes at each start of the sensor; None: not sent.
    """

    frame: int
    initialization: int | None
    first: int
    times_ns: NDArray[np.uint64]
    valid: NDArray[np.bool_]
    columns: NDArray[np.void]


def read(data: bytes, layout: Layout, metadata: Metadata) -> Packet:
    """Raises PacketRefused."""
    _check_size(data, layout, metadata)
    columns: NDArray[Any] = np.frombuffer(data, layout.column, metadata.columns_per_packet, layout.header)
    frame, initialization = _legacy_frame(columns) if layout.legacy else _header(data, metadata)
    first = _first(columns["measurement"], metadata)
    status = columns["status"]
    valid: NDArray[np.bool_] = status == _LEGACY_VALID if layout.legacy else (status & 1).astype(np.bool_)
    if layout.legacy:
        _check_encoder(columns["encoder"], first, valid, metadata)
    times_ns = columns["timestamp"]
    _check_times(times_ns[valid], metadata)
    _check_window(first, valid, metadata)
    return Packet(frame, initialization, first, times_ns, valid, columns)


def _check_size(data: bytes, layout: Layout, metadata: Metadata) -> None:
    if len(data) == layout.size:
        return
    expected = f"expected {layout.size}: {layout.profile} of {metadata.pixels_per_column} beams"
    whose = resembles(len(data), metadata.columns_per_packet)
    if whose:
        raise OtherSensor(f"a packet has {len(data)} bytes, as those in {whose}; {expected} by the metadata")
    raise PacketRefused(f"a packet has {len(data)} bytes, {expected}")


def _header(data: bytes, metadata: Metadata) -> tuple[int, int]:
    kind, frame, initialization, serial = _HEADER.unpack_from(data)
    if kind != _LIDAR_DATA:
        raise PacketRefused(f"the packet is of type 0x{kind:04X}, expected 0x0001")
    number = int.from_bytes(serial, "little")
    if number != int(metadata.prod_sn):
        raise OtherSensor(f"the sensor's serial number is {number}, expected {metadata.prod_sn} by the metadata")
    return frame, int.from_bytes(initialization, "little")


def _legacy_frame(columns: NDArray[Any]) -> tuple[int, None]:
    frames = columns["frame"]
    if (frames != frames[0]).any():
        raise PacketRefused(f"a packet's columns are of frames {frames.min()} and {frames.max()}, expected one")
    return int(frames[0]), None


def _first(places: NDArray[np.uint16], metadata: Metadata) -> int:
    first, count = int(places[0]), metadata.columns_per_packet
    if first % count or (np.diff(places.astype(np.int64)) != 1).any():
        seen = f"a packet's columns are {first} to {places[-1]}"
        raise PacketRefused(f"{seen}, expected {count} from a multiple of {count} on")
    if first >= metadata.columns_per_frame:
        raise OtherSensor(f"a packet begins at column {first}, expected one of {metadata.columns_per_frame}")
    return first


def _check_encoder(ticks: NDArray[np.uint32], first: int, valid: NDArray[np.bool_], metadata: Metadata) -> None:
    """Determines the mode from its place in the turn, for sensors that do not send it: 512, 1024 or 2048 columns."""
    step = ENCODER_TICKS // metadata.columns_per_frame
    off = (ticks.astype(np.int64) - step * (first + np.arange(len(ticks))))[valid]
    off = (off + ENCODER_TICKS // 2) % ENCODER_TICKS - ENCODER_TICKS // 2
    if (np.abs(off) > step).any():
        turn = f"{metadata.columns_per_frame} columns of a turn by the metadata"
        raise OtherSensor(f"column {first} lies at encoder tick {ticks[0]}, expected {step * first}: {turn}")


def _check_times(times_ns: NDArray[np.uint64], metadata: Metadata) -> None:
    if len(times_ns) < 2:
        return
    longest_ns = _SPAN * 1e9 * metadata.period_s * metadata.columns_per_packet / metadata.columns_per_frame
    if (times_ns[1:] < times_ns[:-1]).any() or int(times_ns[-1]) - int(times_ns[0]) > longest_ns:
        times = f"from {times_ns[0]} to {times_ns[-1]} ns"
        raise PacketRefused(f"a packet's columns lie {times}, expected rising times within {longest_ns:.0f} ns")


def _check_window(first: int, valid: NDArray[np.bool_], metadata: Metadata) -> None:
    places = first + np.flatnonzero(valid)
    inside = metadata.in_window(places)
    if not inside.all():
        place, (begin, end) = places[~inside][0], metadata.window
        raise OtherSensor(f"column {place} is measured, expected {begin} to {end} by the metadata's column_window")
