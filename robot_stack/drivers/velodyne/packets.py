"""Data packets of a VLP-16 (Velodyne, VLP-16 User Manual 63-9243): checks before decoding."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

SIZE: Final = 1206
HOUR_US: Final = 3_600_000_000
_BLOCK, _BLOCKS, _FLAG, _TURN = 100, 12, b"\xff\xee", 36000
_FOOTER = struct.Struct("<IBB")
_MODELS: Final = {0x22: "VLP-16", 0x24: "Puck Hi-Res"}
_STRONGEST, _LAST, _DUAL = 0x37, 0x38, 0x39
_FIRINGS, _FIRING_S = 24, 55.296e-6


class PacketRefused(Exception):
    """An invalid packet. The message is one line: what was found and what was expected."""


@dataclass(frozen=True, slots=True)
class Packet:
    """hour_us: of its first firing, us past the hour. duration_s: to the first firing of the next packet."""

    data: bytes
    model: str
    hour_us: int
    duration_s: float


def read(data: bytes) -> Packet:
    """Raises PacketRefused."""
    if len(data) != SIZE:
        raise PacketRefused(f"a packet has {len(data)} bytes, expected {SIZE}")
    for begin in range(0, _BLOCK * _BLOCKS, _BLOCK):
        if data[begin : begin + 2] != _FLAG:
            raise PacketRefused(f"block {begin // _BLOCK} begins with {data[begin : begin + 2].hex()}, expected ffee")
        azimuth = int.from_bytes(data[begin + 2 : begin + 4], "little")
        if azimuth >= _TURN:
            raise PacketRefused(f"block {begin // _BLOCK} is at {azimuth / 100.0} deg, expected less than 360")
    hour_us, mode, model = _FOOTER.unpack_from(data, _BLOCK * _BLOCKS)
    if model not in _MODELS:
        raise PacketRefused(f"the sensor is of model 0x{model:02X}, expected {' or '.join(_MODELS.values())}")
    if mode not in (_STRONGEST, _LAST, _DUAL):
        raise PacketRefused(f"the return mode is 0x{mode:02X}, expected 0x37, 0x38 or 0x39")
    if hour_us >= HOUR_US:
        raise PacketRefused(f"the time is {hour_us} us past the hour, expected less than {HOUR_US}")
    firings = _FIRINGS // 2 if mode == _DUAL else _FIRINGS
    return Packet(data, _MODELS[model], hour_us, firings * _FIRING_S)
