"""Simulates an Ouster sensor's UDP packets, written byte by byte from the Firmware User Manual's "Lidar Data".

It uses no code of the decoder. The head turns clockwise from the connector, which points backwards.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

COLUMNS_PER_PACKET = 16
TICKS = 90112
LEGACY, SINGLE = "LEGACY", "RNG19_RFL8_SIG16_NIR16"
DUAL, LOW_RATE = "RNG19_RFL8_SIG16_NIR16_DUAL", "RNG15_RFL8_NIR8"
PROFILES = (LEGACY, SINGLE, DUAL, LOW_RATE)
NOISE = 0xA5  # in all bytes that are not read

# Range and reflectivity of beam i in a column of a frame, mm; 0 mm: no return.
Seen = Callable[[int, int, int], tuple[int, int]]


def wall(frame: int, column: int, beam: int) -> tuple[int, int]:
    return 10_000, 50


@dataclass(frozen=True)
class Os:
    """begin_ns: start of its clock. window: first and last measured column. serial, initialization: of headers."""

    seen: Seen = wall
    profile: str = SINGLE
    beams: int = 32
    columns: int = 512
    window: tuple[int, int] | None = None
    begin_ns: int = 5_000_000_000
    first_frame: int = 100
    serial: int = 122_201_000_998
    initialization: int = 7_109_750

    @property
    def packets_per_frame(self) -> int:
        return self.columns // COLUMNS_PER_PACKET

    @property
    def packet_s(self) -> float:
        return 0.1 / self.packets_per_frame

    def altitude_deg(self, beam: int) -> float:
        return 20.0 - 40.0 * beam / (self.beams - 1)

    def azimuth_deg(self, beam: int) -> float:
        return (4.2, 1.4, -1.4, -4.2)[beam % 4]

    def time_ns(self, number: int, column: int) -> int:
        """Time of a column of the ``number``-th frame."""
        return self.begin_ns + round(1e8 * (number + column / self.columns))

    def metadata(self, **changes: Any) -> str:
        """The response of ``GET /api/v1/sensor/metadata`` since firmware 3; a value of None is left out."""
        data: dict[str, dict[str, Any]] = {
            "sensor_info": {
                "prod_line": f"OS-1-{self.beams}",
                "prod_sn": str(self.serial),
                "initialization_id": self.initialization,
                "status": "RUNNING",
            },
            "config_params": {"lidar_mode": f"{self.columns}x10", "udp_port_lidar": 7502},
            "lidar_data_format": {
                "udp_profile_lidar": self.profile,
                "udp_profile_imu": "LEGACY",
                "pixels_per_column": self.beams,
                "columns_per_frame": self.columns,
                "columns_per_packet": COLUMNS_PER_PACKET,
                "column_window": list(self.window or (0, self.columns - 1)),
                "pixel_shift_by_row": [6, 2, -2, -6] * (self.beams // 4),
            },
            "beam_intrinsics": {
                "beam_altitude_angles": [self.altitude_deg(beam) for beam in range(self.beams)],
                "beam_azimuth_angles": [self.azimuth_deg(beam) for beam in range(self.beams)],
                "lidar_origin_to_beam_origin_mm": 15.806,
                "beam_to_lidar_transform": [1, 0, 0, 15.806, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
            },
            "lidar_intrinsics": {"lidar_to_sensor_transform": [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 36.18, 0, 0, 0, 1]},
        }
        for section in data.values():
            section.update({name: changes[name] for name in section.keys() & changes.keys()})
            for name in [name for name, value in section.items() if value is None]:
                del section[name]
        return json.dumps(data)

    def flat_metadata(self) -> str:
        """The responses before firmware 3, such as ``get_config_txt``: one flat object, except the data format."""
        data = json.loads(self.metadata())
        flat = {"data_format": data["lidar_data_format"], "lidar_mode": data["config_params"]["lidar_mode"]}
        return json.dumps(flat | data["sensor_info"] | data["beam_intrinsics"] | data["lidar_intrinsics"])

    def after(self, **changes: Any) -> Os:
        return replace(self, **changes)

    def packets(self, count: int, skip: int = 0) -> Iterator[bytes]:
        """``count`` packets of the window after skipping ``skip``; a full turn has one every ``packet_s``."""
        sent = 0
        for index in range(1 << 20):
            number, place = divmod(index, self.packets_per_frame)
            first = place * COLUMNS_PER_PACKET
            if not any(self.measured(column) for column in range(first, first + COLUMNS_PER_PACKET)):
                continue
            if sent >= skip + count:
                return
            if sent >= skip:
                yield self.packet(number, first)
            sent += 1

    def measured(self, column: int) -> bool:
        begin, end = self.window or (0, self.columns - 1)
        return begin <= column <= end if begin <= end else column >= begin or column <= end

    def packet(self, number: int, first: int) -> bytes:
        """The packet of the ``number``-th frame that starts with column ``first``."""
        frame = (self.first_frame + number) % 65536
        columns = b"".join(self._column(number, frame, first + i) for i in range(COLUMNS_PER_PACKET))
        if self.profile == LEGACY:
            return columns
        serial = self.serial.to_bytes(5, "little")
        header = struct.pack("<HH", 1, frame) + self.initialization.to_bytes(3, "little") + serial
        return header + bytes([NOISE]) * 20 + columns + bytes([NOISE]) * 32

    def _column(self, number: int, frame: int, column: int) -> bytes:
        good = self.measured(column)
        seen = [self.seen(number, column, beam) if good else (0, 0) for beam in range(self.beams)]
        pixels = b"".join(self._pixel(mm, reflectivity) for mm, reflectivity in seen)
        time_ns = self.time_ns(number, column)
        if self.profile == LEGACY:
            head = struct.pack("<QHHI", time_ns, column, frame, column * TICKS // self.columns)
            return head + pixels + struct.pack("<I", 0xFFFFFFFF if good else 0)
        return struct.pack("<QHH", time_ns, column, 1 if good else 0) + pixels

    def _pixel(self, mm: int, reflectivity: int) -> bytes:
        """Signal, near infrared, reserved bytes and the second return are noise."""
        if self.profile == LEGACY:
            return struct.pack("<IH", mm | NOISE << 24, reflectivity) + bytes([NOISE]) * 6
        if self.profile == SINGLE:
            return struct.pack("<IBB", mm | NOISE << 24, reflectivity, NOISE) + bytes([NOISE]) * 6
        if self.profile == DUAL:
            return struct.pack("<I", mm | reflectivity << 24) + bytes([NOISE]) * 12
        return struct.pack("<HBB", mm // 8 | 0x8000, reflectivity, NOISE)
