"""PointCloud2 messages written and read without copying the points."""

from __future__ import annotations

from array import array

import numpy as np
from sensor_msgs.msg import PointCloud2, PointField

from robot_stack.core.point_cloud import Points
from robot_stack.middleware.wire import CloudView

_TYPES = {
    np.dtype("<f4"): PointField.FLOAT32,
    np.dtype("<f8"): PointField.FLOAT64,
    np.dtype("<u2"): PointField.UINT16,
    np.dtype("<u1"): PointField.UINT8,
    np.dtype("<u4"): PointField.UINT32,
}


def cloud_message(points: Points, frame_id: str) -> PointCloud2:
    """An unorganised cloud of a structured array; the stamp is the caller's to set."""
    layout = points.dtype
    assert layout.fields is not None, "a structured array is needed"
    assert layout.names is not None
    fields = [
        PointField(name=name, offset=layout.fields[name][1], datatype=_TYPES[layout.fields[name][0]], count=1)
        for name in layout.names
    ]
    message = PointCloud2(
        height=1, width=len(points), fields=fields, point_step=layout.itemsize, is_dense=True, is_bigendian=False
    )
    message.header.frame_id = frame_id
    fill(message, points)
    return message


def fill(message: PointCloud2, points: Points) -> None:
    """Replaces the points of a message made by ``cloud_message``."""
    data = array("B")
    data.frombytes(np.ascontiguousarray(points).view(np.uint8).data)  # an array is assigned whole, a list byte by byte
    message.width, message.row_step = len(points), points.nbytes
    message.data = data


def points_of(message: PointCloud2 | CloudView, layout: np.dtype[np.void]) -> Points:
    """The points as a structured array on the message's own memory; do not write to it.

    Fields of ``layout`` are found by name, at the offsets that the message gives; additional fields are allowed.
    Raises ValueError for a field that is missing or of another type, and for data of a wrong length.
    """
    found = {field.name: field for field in message.fields}
    offsets, formats = [], []
    assert layout.fields is not None
    assert layout.names is not None
    for name in layout.names:
        wanted = layout.fields[name][0]
        field = found.get(name)
        if field is None:
            raise ValueError(f"field {name} is missing; there are {', '.join(found) or 'none'}")
        if field.datatype != _TYPES[wanted] or message.is_bigendian:
            raise ValueError(f"field {name} is not of type {wanted}")
        offsets.append(field.offset)
        formats.append(wanted)
    count = message.width * message.height
    if message.point_step == 0 or len(message.data) != count * message.point_step:
        raise ValueError(f"{len(message.data)} bytes are not {count} points of {message.point_step} bytes")
    there = np.dtype(
        {"names": list(layout.names), "formats": formats, "offsets": offsets, "itemsize": message.point_step}
    )
    data = message.data if isinstance(message.data, np.ndarray) else np.frombuffer(message.data, np.uint8)
    return data.view(there)
