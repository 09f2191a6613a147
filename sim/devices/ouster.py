"""An Ouster sensor: its packets in the profile RNG19_RFL8_SIG16_NIR16, and its metadata.

Source: Ouster Firmware User Manual, "Lidar Data" and "Sensor Metadata". The head turns clockwise from the connector,
which points backwards. Beams start at the head's axis, which no sensor's do, because those of the simulation do.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.point_cloud import Points, xyz_of
from sim.lidar.params import Beams

COLUMNS_PER_PACKET: Final = 16
_SERIAL, _INITIALIZATION = 122_201_000_998, 7_109_750
_CONNECTOR_DEG = 180.0
_LIDAR_DATA = 1
_MEASURED = 1
_TURNED = [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]  # the connector's direction to the one ahead
_UNMOVED = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]


class OusterSensor:
    """beams: its scan pattern. Raises ValueError for one that no such sensor has."""

    def __init__(self, beams: Beams) -> None:
        if beams.start_azimuth_deg != _CONNECTOR_DEG or beams.columns % (2 * COLUMNS_PER_PACKET):
            raise ValueError(
                f"an Ouster's columns begin at {_CONNECTOR_DEG:g} deg, and are a multiple of {2 * COLUMNS_PER_PACKET}; "
                f"here at {beams.start_azimuth_deg:g} deg, {beams.columns}"
            )
        self._beams = beams
        self._packet = _packet_type(beams.rings)

    def packets(self, points: Points, frame: int, columns: tuple[int, int], end_s: float) -> Iterator[bytes]:
        """The packets of columns first to last - 1 of a turn.

        points: ``SWEEP`` of these columns. frame: number of the turn. end_s: of column last - 1, by the sensor's clock.
        """
        first, last = columns
        column_s = self._beams.period_s / self._beams.columns
        steps = np.zeros((last - first, self._beams.rings), np.uint32)
        reflectivity = np.zeros(steps.shape, np.uint8)
        place = last - first - 1 + np.rint(points["time"] / column_s).astype(np.int64)
        row = self._beams.rings - 1 - points["ring"].astype(np.int64)  # row 0 is the highest beam
        steps[place, row] = np.rint(1e3 * np.linalg.norm(xyz_of(points), axis=1))
        reflectivity[place, row] = np.clip(points["intensity"], 0.0, 255.0)
        data = np.zeros((last - first) // COLUMNS_PER_PACKET, self._packet)
        data["type"], data["frame"] = _LIDAR_DATA, frame % (1 << 16)
        data["initialization"] = _bytes(_INITIALIZATION, 3)
        data["serial"] = _bytes(_SERIAL, 5)
        by_packet = len(data), COLUMNS_PER_PACKET
        times_s = end_s + column_s * np.arange(first - last + 1, 1)
        data["columns"]["timestamp"] = np.rint(1e9 * times_s).astype(np.uint64).reshape(by_packet)
        data["columns"]["measurement"] = np.arange(first, last).reshape(by_packet)
        data["columns"]["status"] = _MEASURED
        data["columns"]["pixels"]["range"] = steps.reshape(*by_packet, -1)
        data["columns"]["pixels"]["reflectivity"] = reflectivity.reshape(*by_packet, -1)
        for packet in data:
            yield packet.tobytes()

    def metadata(self) -> str:
        """The response of ``GET /api/v1/sensor/metadata``."""
        beams = self._beams
        altitudes = np.linspace(beams.highest_deg, beams.lowest_deg, beams.rings)
        data: dict[str, dict[str, Any]] = {
            "sensor_info": {
                "prod_line": f"OS-1-{beams.rings}",
                "prod_sn": str(_SERIAL),
                "initialization_id": _INITIALIZATION,
                "status": "RUNNING",
            },
            "config_params": {"lidar_mode": f"{beams.columns}x{round(1.0 / beams.period_s)}", "udp_port_lidar": 7502},
            "lidar_data_format": {
                "udp_profile_lidar": "RNG19_RFL8_SIG16_NIR16",
                "udp_profile_imu": "LEGACY",
                "pixels_per_column": beams.rings,
                "columns_per_frame": beams.columns,
                "columns_per_packet": COLUMNS_PER_PACKET,
                "column_window": [0, beams.columns - 1],
                "pixel_shift_by_row": [0] * beams.rings,
            },
            "beam_intrinsics": {
                "beam_altitude_angles": [round(float(angle), 6) for angle in altitudes],
                "beam_azimuth_angles": [0] * beams.rings,
                "lidar_origin_to_beam_origin_mm": 0,
                "beam_to_lidar_transform": _UNMOVED,
            },
            "lidar_intrinsics": {"lidar_to_sensor_transform": _TURNED},
        }
        return json.dumps(data) + "\n"


def _packet_type(rings: int) -> np.dtype[np.void]:
    pixel = np.dtype({"names": ["range", "reflectivity"], "formats": ["<u4", "u1"], "offsets": [0, 4], "itemsize": 12})
    column = np.dtype([("timestamp", "<u8"), ("measurement", "<u2"), ("status", "<u2"), ("pixels", pixel, (rings,))])
    return np.dtype(
        [
            ("type", "<u2"),
            ("frame", "<u2"),
            ("initialization", "u1", (3,)),
            ("serial", "u1", (5,)),
            ("reserved", "u1", (20,)),
            ("columns", column, (COLUMNS_PER_PACKET,)),
            ("footer", "u1", (32,)),
        ]
    )


def _bytes(number: int, count: int) -> NDArray[np.uint8]:
    return np.frombuffer(number.to_bytes(count, "little"), np.uint8)
