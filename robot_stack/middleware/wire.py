"""Clouds and images read in place, from the received bytes.

The middleware copies a cloud of 2.4 MB three times until Python has it as a message; here the points are not copied.
The bytes are OMG CDR (DDS-XTYPES 7.4), little endian; other encodings are left to the middleware.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from std_msgs.msg import Header

_LITTLE_ENDIAN = b"\x00\x01"
_PREFIX = 4  # encoding header; alignment counts from its end
_U32 = struct.Struct("<I")
_STAMP = struct.Struct("<iI")


@dataclass(frozen=True, slots=True)
class FieldView:
    """Like PointField."""

    name: str
    offset: int
    datatype: int
    count: int


@dataclass(frozen=True, slots=True)
class CloudView:
    """Like PointCloud2; ``data`` lies in the bytes that were received."""

    header: Header
    height: int
    width: int
    fields: tuple[FieldView, ...]
    is_bigendian: bool
    point_step: int
    row_step: int
    data: NDArray[np.uint8]
    is_dense: bool


@dataclass(frozen=True, slots=True)
class ImageView:
    """Like Image; ``data`` lies in the bytes that were received."""

    header: Header
    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    data: NDArray[np.uint8]


class _Cursor:
    """Reads values one after the other."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = _PREFIX

    def u8(self) -> int:
        self._at += 1
        return self._data[self._at - 1]

    def u32(self) -> int:
        self._align()
        (value,) = _U32.unpack_from(self._data, self._at)
        self._at += _U32.size
        return int(value)

    def text(self) -> str:
        size = self.u32()
        value = self._data[self._at : self._at + size - 1].decode()
        self._at += size
        return value

    def header(self) -> Header:
        self._align()
        seconds, nanoseconds = _STAMP.unpack_from(self._data, self._at)
        self._at += _STAMP.size
        return Header(stamp=Time(sec=seconds, nanosec=nanoseconds), frame_id=self.text())

    def octets(self) -> NDArray[np.uint8]:
        size, begin = self.u32(), self._at
        self._at += size
        if self._at > len(self._data):
            raise ValueError("the message ends within its data")
        return np.asarray(_Lent(self._data, begin, size))

    def _align(self) -> None:
        self._at += -(self._at - _PREFIX) % _U32.size


class _Lent:
    """Bytes as an array without a copy; keeps them alive.

    numpy marks an array on bytes read-only, for which every compiled loop would be compiled a second time. Received
    messages are never written to.
    """

    def __init__(self, data: bytes, begin: int, size: int) -> None:
        self._data = data
        address = np.frombuffer(data, np.uint8).ctypes.data + begin
        self.__array_interface__ = {"data": (address, False), "shape": (size,), "typestr": "|u1", "version": 3}


def _cloud(data: bytes) -> CloudView:
    read = _Cursor(data)
    header, height, width = read.header(), read.u32(), read.u32()
    fields = tuple(FieldView(read.text(), read.u32(), read.u8(), read.u32()) for _ in range(read.u32()))
    return CloudView(
        header, height, width, fields, bool(read.u8()), read.u32(), read.u32(), read.octets(), bool(read.u8())
    )


def _image(data: bytes) -> ImageView:
    read = _Cursor(data)
    return ImageView(read.header(), read.u32(), read.u32(), read.text(), read.u8(), read.u32(), read.octets())


class UnknownEncoding(ValueError):
    """The bytes are not little-endian CDR of the expected message."""


def _reader(view: Callable[[bytes], Any]) -> Callable[[bytes], Any]:
    def read(data: bytes) -> Any:
        if data[:2] == _LITTLE_ENDIAN:
            try:
                return view(data)
            except (struct.error, IndexError, ValueError) as error:
                raise UnknownEncoding(str(error)) from error
        raise UnknownEncoding(f"the encoding is {data[:2].hex()}")

    return read


READERS: Final[dict[str, Callable[[bytes], Any]]] = {
    "sensor_msgs/msg/PointCloud2": _reader(_cloud),
    "sensor_msgs/msg/Image": _reader(_image),
}
"""By type: reads a message from its bytes, as a view with the message's fields. Raises UnknownEncoding."""
