"""Messages as serialised bytes, made once; each publication only fills in stamp and numbers.

The bytes are OMG CDR, little endian, as serialised by the middleware from a prototype. Building, converting and
serialising a message of many Python objects costs several times more than sending it.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from numpy.typing import NDArray
from sensor_msgs.msg import Image, PointCloud2

from robot_stack.contract import frames
from robot_stack.core.point_cloud import Points
from robot_stack.ros.serialization import serialize_message
from tf2_msgs.msg import TFMessage

_STAMP_AT = 4  # of a message that begins with a header, behind the four bytes of the encoding
_STAMP = struct.Struct("<iI")
_LENGTH = struct.Struct("<I")
_DOUBLE = 8


class Numbers:
    """A message that begins with a header and ends with float64 numbers, such as Odometry, Imu or JointState.

    Places are counted in numbers from the message's end.
    """

    def __init__(self, prototype: Any) -> None:
        self._data = bytearray(serialize_message(prototype))

    def put(self, place: int, values: Sequence[float]) -> None:
        """``values`` from ``place`` numbers before the end on."""
        struct.pack_into(f"<{len(values)}d", self._data, len(self._data) - _DOUBLE * place, *values)

    def stamped(self, stamp: Time) -> bytes:
        _STAMP.pack_into(self._data, _STAMP_AT, stamp.sec, stamp.nanosec)
        return bytes(self._data)


class Transforms:
    """A TFMessage with poses in map of bodies whose names seldom change."""

    def __init__(self) -> None:
        self._names: tuple[str, ...] = ()
        self._data = bytearray()
        self._places: list[tuple[int, int]] = []

    def filled(self, bodies: Sequence[tuple[str, NDArray[np.float64]]], stamp: Time) -> bytes:
        """Frame ids and poses in map: (7,) x y z m, w x y z."""
        names = tuple(name for name, _ in bodies)
        if names != self._names:
            self._lay_out(names)
        for (_, pose), (stamp_at, numbers_at) in zip(bodies, self._places, strict=True):
            x, y, z, qw, qx, qy, qz = pose.tolist()
            _STAMP.pack_into(self._data, stamp_at, stamp.sec, stamp.nanosec)
            _POSE.pack_into(self._data, numbers_at, x, y, z, qx, qy, qz, qw)
        return bytes(self._data)

    def _lay_out(self, names: tuple[str, ...]) -> None:
        message = TFMessage(transforms=[TransformStamped(child_frame_id=name) for name in names])
        for item in message.transforms:
            item.header.frame_id = frames.MAP
        self._names, self._data = names, bytearray(serialize_message(message))
        self._places = [(stamp_at, numbers_at) for stamp_at, _, numbers_at in walk_transforms(self._data)]


_POSE = struct.Struct("<7d")


def walk_transforms(data: bytes | bytearray) -> list[tuple[int, str, int]]:
    """Of each transform of a serialised TFMessage: where its stamp lies, child_frame_id, where its seven numbers lie.

    Raises struct.error or IndexError for bytes that are none.
    """
    found = []
    (count,) = _LENGTH.unpack_from(data, 4)
    at = 8
    for _ in range(count):
        stamp_at = at = _aligned(at, 4)
        at = _aligned(_behind_string(data, at + _STAMP.size), 4)
        end = _behind_string(data, at)
        name = bytes(data[at + _LENGTH.size : end - 1]).decode()
        at = _aligned(end, _DOUBLE)
        found.append((stamp_at, name, at))
        at += _POSE.size
    return found


def read_transforms(data: bytes) -> tuple[float, dict[str, tuple[float, ...]]]:
    """Stamp of the first, s, and x y z, quaternion x y z w by child_frame_id, of a serialised TFMessage."""
    places = walk_transforms(data)
    if not places:
        return 0.0, {}
    seconds, nanoseconds = _STAMP.unpack_from(data, places[0][0])
    return seconds + 1e-9 * nanoseconds, {name: _POSE.unpack_from(data, at) for _, name, at in places}


class CloudBytes:
    """A PointCloud2 like ``prototype``, which has no points, with others each time."""

    def __init__(self, prototype: PointCloud2) -> None:
        data = serialize_message(prototype)
        self._head, self._tail = bytearray(data[:-1]), data[-1:]  # is_dense follows the points
        self._width_at = _aligned(_behind_string(data, _STAMP_AT + _STAMP.size), 4) + _LENGTH.size

    def filled(self, points: Points, stamp: Time) -> bytes:
        head, size = self._head, points.nbytes
        _STAMP.pack_into(head, _STAMP_AT, stamp.sec, stamp.nanosec)
        _LENGTH.pack_into(head, self._width_at, len(points))
        struct.pack_into("<II", head, len(head) - 2 * _LENGTH.size, size, size)  # row_step, and how much data
        return b"".join((head, points.view(np.uint8).data, self._tail))


class ImageBytes:
    """An Image like ``prototype``, which has no data, with (height, width) mono8 pictures."""

    def __init__(self, prototype: Image) -> None:
        self._head = bytearray(serialize_message(prototype))

    def filled(self, picture: NDArray[np.uint8], stamp: Time) -> bytes:
        head = self._head
        _STAMP.pack_into(head, _STAMP_AT, stamp.sec, stamp.nanosec)
        _LENGTH.pack_into(head, len(head) - _LENGTH.size, picture.size)
        return b"".join((head, picture.data))


def restamped(message: bytes, stamp: Time) -> bytes:
    """A message that begins with a header, at another time."""
    data = bytearray(message)
    _STAMP.pack_into(data, _STAMP_AT, stamp.sec, stamp.nanosec)
    return bytes(data)


def _aligned(at: int, size: int) -> int:
    return at + (_STAMP_AT - at) % size  # alignment counts from behind the encoding


def _behind_string(data: bytes | bytearray, at: int) -> int:
    """Where a string that begins with its length ends."""
    return at + _LENGTH.size + int(_LENGTH.unpack_from(data, at)[0])
