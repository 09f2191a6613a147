"""Clouds as vendors' drivers publish them: field offsets and types, stamps and empty points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robot_stack.drivers.point_cloud.cloud import TYPES, Cloud, Field

# 2026-11-22, on the sensor's and on this computer's clock.
START_S = 1_795_000_000.0
SPAN_S = 0.0999
U8, U16, U32, F32, F64 = 2, 4, 6, 7, 8


@dataclass(frozen=True)
class Vendor:
    """fields: name, offset, type. organised: rows are rings. top_down: ring 0 is the highest. time: of each point."""

    name: str
    point_step: int
    fields: tuple[tuple[str, int, int], ...]
    time: str
    ring: str = "ring"
    organised: bool = False
    top_down: bool = False
    frame_id: str = "vendor_frame"
    absolute: bool = False
    unit_s: float = 1.0


XYZ = (("x", 0, F32), ("y", 4, F32), ("z", 8, F32))
OUSTER = Vendor(
    "ouster",
    48,
    (*XYZ, ("intensity", 16, F32), ("t", 20, U32), ("reflectivity", 24, U16), ("ring", 26, U16), ("ambient", 28, U16),
     ("range", 32, U32)),
    "t", organised=True, top_down=True, unit_s=1e-9,
)  # fmt: skip
VELODYNE = Vendor("velodyne", 22, (*XYZ, ("intensity", 12, F32), ("ring", 16, U16), ("time", 18, F32)), "time")
HESAI = Vendor(
    "hesai", 26, (*XYZ, ("intensity", 12, F32), ("ring", 16, U16), ("timestamp", 18, F64)), "timestamp",
    top_down=True, absolute=True,
)  # fmt: skip
ROBOSENSE = Vendor(
    "robosense", 32, (*XYZ, ("intensity", 16, F32), ("ring", 20, U16), ("timestamp", 24, F64)), "timestamp",
    organised=True, absolute=True,
)  # fmt: skip
LIVOX = Vendor(
    "livox", 26, (*XYZ, ("intensity", 12, F32), ("tag", 16, U8), ("line", 17, U8), ("timestamp", 18, F64)), "timestamp",
    "line", absolute=True, unit_s=1e-9,
)  # fmt: skip
LIVOX_OFFSET = Vendor(
    "livox", 32, (*XYZ, ("reflectivity", 16, U8), ("tag", 17, U8), ("line", 18, U8), ("offset_time", 20, U32)),
    "offset_time", "line", unit_s=1e-9,
)  # fmt: skip
NEBULA = Vendor(
    "nebula", 32,
    (*XYZ, ("intensity", 12, U8), ("return_type", 13, U8), ("channel", 14, U16), ("azimuth", 16, F32),
     ("elevation", 20, F32), ("distance", 24, F32), ("time_stamp", 28, U32)),
    "time_stamp", "channel", top_down=True, unit_s=1e-9,
)  # fmt: skip
VENDORS = (OUSTER, VELODYNE, HESAI, ROBOSENSE, LIVOX, LIVOX_OFFSET, NEBULA)


@dataclass(frozen=True)
class Scene:
    """All points of a sweep, column by column: xyz (n, 3) m, ring from the lowest, seconds from the first column."""

    xyz: np.ndarray
    ring: np.ndarray
    seconds: np.ndarray
    rings: int
    columns: int


def scene(rings: int = 16, columns: int = 200) -> Scene:
    """Returns a cylinder of 10 m around the sensor."""
    azimuth = np.repeat(np.pi - np.arange(columns) * 2.0 * np.pi / columns, rings)
    elevation = np.tile(np.radians(np.linspace(-15.0, 15.0, rings)), columns)
    xyz = np.stack([10.0 * np.cos(azimuth), 10.0 * np.sin(azimuth), 10.0 * np.tan(elevation)], axis=1)
    seconds = np.repeat(np.linspace(0.0, SPAN_S, columns), rings)
    return Scene(xyz.astype(np.float32), np.tile(np.arange(rings), columns), seconds, rings, columns)


def cloud_of(
    vendor: Vendor, seen: Scene, *, stamp_s: float | None = None, zero_s: float = 0.0, start_s: float = START_S,
    padding: int = 0,
) -> Cloud:  # fmt: skip
    """stamp_s: header stamp, by default the first point's. zero_s: zero of the offsets after the first point.

    padding: bytes behind each row.
    """
    dtype = np.dtype(
        {
            "names": [name for name, _, _ in vendor.fields],
            "formats": [TYPES[kind] for _, _, kind in vendor.fields],
            "offsets": [offset for _, offset, _ in vendor.fields],
            "itemsize": vendor.point_step,
        }
    )
    points = np.zeros(len(seen.xyz), dtype)
    points["x"], points["y"], points["z"] = seen.xyz.T
    points[vendor.ring] = seen.rings - 1 - seen.ring if vendor.top_down else seen.ring
    times = seen.seconds + start_s if vendor.absolute else seen.seconds - zero_s
    points[vendor.time] = np.round(times / vendor.unit_s) if vendor.unit_s != 1.0 else times
    for name in ("intensity", "reflectivity"):
        if name in dtype.names:
            points[name] = 100
    shape = (1, len(points))
    if vendor.organised:  # row 0 is the vendor's ring 0
        columns = points.reshape(seen.columns, seen.rings)
        points, shape = (columns[:, ::-1] if vendor.top_down else columns).T, (seen.rings, seen.columns)
    rows = np.ascontiguousarray(points).reshape(shape).view(np.uint8)
    rows = np.concatenate([rows, np.full((shape[0], padding), 0xAA, np.uint8)], axis=1)
    fields = tuple(Field(name, offset, kind, 1) for name, offset, kind in vendor.fields)
    return Cloud(
        vendor.frame_id, start_s if stamp_s is None else stamp_s, *shape, fields, False, vendor.point_step,
        rows.shape[1], rows.reshape(-1),
    )  # fmt: skip


def with_points(cloud: Cloud, vendor: Vendor, name: str, index: int, value: float) -> Cloud:
    """Returns a copy with another value in one field of one point, counted in byte order."""
    data = cloud.data.copy()
    offset, kind = next((offset, kind) for field, offset, kind in vendor.fields if field == name)
    row, column = divmod(index, cloud.width)
    at = row * cloud.row_step + column * cloud.point_step + offset
    data[at : at + TYPES[kind].itemsize] = np.array([value], TYPES[kind]).view(np.uint8)
    return replace(cloud, data=data)
