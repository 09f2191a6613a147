"""A PointCloud2 as values, its points without a copy. An unreadable cloud is rejected with a reason."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

# sensor_msgs/msg/PointField
TYPES: Final[dict[int, np.dtype[np.generic]]] = {
    1: np.dtype("<i1"),
    2: np.dtype("<u1"),
    3: np.dtype("<i2"),
    4: np.dtype("<u2"),
    5: np.dtype("<i4"),
    6: np.dtype("<u4"),
    7: np.dtype("<f4"),
    8: np.dtype("<f8"),
}


class CloudRefused(Exception):
    """An invalid cloud. The message is one line: what was found and what was expected."""


@dataclass(frozen=True, slots=True)
class Field:
    """As in PointField."""

    name: str
    offset: int
    datatype: int
    count: int

    def describe(self) -> str:
        kind = TYPES.get(self.datatype)
        return f"{self.name} {kind.name if kind is not None else f'of unknown type {self.datatype}'}"


@dataclass(frozen=True, slots=True)
class Cloud:
    """As in PointCloud2. data: (n,) bytes. stamp_s: of the header, by the clock of its sender."""

    frame_id: str
    stamp_s: float
    height: int
    width: int
    fields: tuple[Field, ...]
    is_bigendian: bool
    point_step: int
    row_step: int
    data: NDArray[np.uint8]

    def describe_fields(self) -> str:
        return ", ".join(field.describe() for field in self.fields) or "none"


def columns_at(cloud: Cloud, fields: dict[str, Field]) -> dict[str, NDArray[Any]]:
    """(n,) each: the given fields of the points of ``cloud``, under the keys' names and in the fields' own types.

    An organised cloud is read column by column: the points of a column are measured together, whatever its rows are.
    Raises CloudRefused for a cloud whose bytes do not match its header.
    """
    _check(cloud)
    layout = np.dtype(
        {
            "names": list(fields),
            "formats": [_type_of(field, cloud.point_step) for field in fields.values()],
            "offsets": [field.offset for field in fields.values()],
            "itemsize": cloud.point_step,
        }
    )
    used = cloud.width * cloud.point_step
    rows = cloud.data[: cloud.height * _row_bytes(cloud)].reshape(cloud.height, _row_bytes(cloud))[:, :used]
    points = np.ascontiguousarray(rows).view(layout)
    return {name: points[name].T.reshape(-1) for name in fields}


def _row_bytes(cloud: Cloud) -> int:
    """Some drivers omit the length of a single row."""
    return cloud.row_step if cloud.height != 1 or cloud.row_step else cloud.width * cloud.point_step


def _check(cloud: Cloud) -> None:
    if cloud.is_bigendian:
        raise CloudRefused("the cloud is big endian, expected little endian")
    if cloud.width == 0 or cloud.height == 0:
        raise CloudRefused(f"the cloud has no points: width {cloud.width}, height {cloud.height}")
    used, row = cloud.width * cloud.point_step, _row_bytes(cloud)
    if cloud.point_step == 0 or row < used:
        points = f"{cloud.width} points of {cloud.point_step} bytes"
        raise CloudRefused(f"row_step is {cloud.row_step}, expected at least {points}")
    if len(cloud.data) != cloud.height * row:
        rows = f"{cloud.height} rows of {row} bytes"
        raise CloudRefused(f"the cloud has {len(cloud.data)} bytes of data, expected {rows}")


def _type_of(field: Field, point_step: int) -> np.dtype[np.generic]:
    kind = TYPES.get(field.datatype)
    if kind is None or field.count not in (0, 1):  # some drivers leave the count out
        raise CloudRefused(f"field {field.describe()} with count {field.count}, expected one number")
    if field.offset + kind.itemsize > point_step:
        end = field.offset + kind.itemsize
        raise CloudRefused(f"field {field.describe()} ends at byte {end} of a point of {point_step}")
    return kind
