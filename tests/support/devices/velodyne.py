"""A Velodyne VLP-16 on UDP: data packets of 1206 bytes in its strongest-return mode."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator

FIRING_S = 55.296e-6  # sixteen lasers, one after the other
LASER_S = 2.304e-6
BLOCKS, FIRINGS = 12, 2  # of a packet, and of a block
PACKET_S = BLOCKS * FIRINGS * FIRING_S
ELEVATIONS_DEG = (-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15)
_FLAG, _STRONGEST, _VLP_16 = b"\xff\xee", 0x37, 0x22
_STEP_M = 0.002
_HOUR_S = 3600.0

# Measurement of the laser of an elevation at an azimuth, both degrees: m and reflectivity; 0 m: nothing.
Seen = Callable[[float, float], tuple[float, int]]


class Vlp16:
    """Turns at ``turns_hz``, clockwise from azimuth 0. hour_s: its time past the hour, synchronised to nothing."""

    def __init__(self, seen: Seen, turns_hz: float = 10.0, hour_s: float = 0.0) -> None:
        self._seen, self._turns_hz, self._begin_s = seen, turns_hz, hour_s
        self._firings = 0

    def packets(self, count: int) -> Iterator[bytes]:
        """The next ``count``, one every ``PACKET_S``."""
        for _ in range(count):
            begin_s = self._begin_s + self._firings * FIRING_S
            blocks = b"".join(self._block() for _ in range(BLOCKS))
            microseconds = int((begin_s % _HOUR_S) * 1e6)
            yield blocks + struct.pack("<IBB", microseconds, _STRONGEST, _VLP_16)

    def azimuth_deg(self, firing: int, laser: int = 0) -> float:
        return 360.0 * self._turns_hz * (firing * FIRING_S + laser * LASER_S) % 360.0

    def _block(self) -> bytes:
        hundredths = math.floor(100.0 * self.azimuth_deg(self._firings)) % 36000
        data = _FLAG + struct.pack("<H", hundredths)
        for _ in range(FIRINGS):
            for laser, elevation in enumerate(ELEVATIONS_DEG):
                distance_m, reflectivity = self._seen(self.azimuth_deg(self._firings, laser), elevation)
                data += struct.pack("<HB", round(distance_m / _STEP_M), reflectivity)
            self._firings += 1
        return data
