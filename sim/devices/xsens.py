"""An Xsens MTi on its serial line: MTData2 at a fixed rate after the command to measure."""

from __future__ import annotations

import struct
from dataclasses import dataclass

_PREAMBLE, _BUS, _GO_TO_MEASUREMENT, _MTDATA2 = 0xFA, 0xFF, 0x10, 0x36
_FILTER_VALID = 2
_TICKS_PER_S = 10_000


@dataclass(frozen=True, slots=True)
class Motion:
    """Its measurement: w x y z, m/s2, rad/s."""

    orientation_wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    acceleration_mps2: tuple[float, float, float] = (0.0, 0.0, 9.81)
    rotation_radps: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Mti:
    """Counts samples of its own clock of 10 kHz, which begins at ``ticks``."""

    def __init__(self, rate_hz: int = 100, ticks: int = 0) -> None:
        self._step, self._ticks, self._counter = _TICKS_PER_S // rate_hz, ticks, 0
        self.measuring = False

    def answer_to(self, data: bytes) -> bytes:
        """Its answer to the host's data."""
        if bytes([_PREAMBLE, _BUS, _GO_TO_MEASUREMENT, 0]) not in data:
            return b""
        self.measuring = True
        return frame(_GO_TO_MEASUREMENT + 1, b"")

    def sample(self, motion: Motion, time_s: float | None = None) -> bytes:
        """The frame of the next sample. time_s: of its clock; None is one period after the last."""
        ticks = self._ticks + self._step if time_s is None else round(_TICKS_PER_S * time_s)
        self._ticks, self._counter = ticks % 2**32, (self._counter + 1) % 2**16
        packets = (
            packet(0x1020, ">H", self._counter)
            + packet(0x1060, ">I", self._ticks)
            + packet(0x2010, ">4f", *motion.orientation_wxyz)
            + packet(0x4020, ">3f", *motion.acceleration_mps2)
            + packet(0x8020, ">3f", *motion.rotation_radps)
            + packet(0xE020, ">I", _FILTER_VALID)
        )
        return frame(_MTDATA2, packets)


def packet(number: int, layout: str, *values: float) -> bytes:
    """One packet of MTData2."""
    data = struct.pack(layout, *values)
    return struct.pack(">HB", number, len(data)) + data


def frame(message: int, data: bytes) -> bytes:
    """A frame of the Xbus protocol, of less than 255 bytes of data."""
    body = bytes([_BUS, message, len(data)]) + data
    return bytes([_PREAMBLE]) + body + bytes([-sum(body) % 256])
