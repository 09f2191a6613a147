"""Joint messages as serialised bytes, made once; a tick only fills in its numbers.

The bytes are OMG CDR (DDS-RTPS 2.3, 10.5: plain CDR, little endian), equal to rmw_serialize's for the same message
except for its padding. Only stamp and float64 values change between ticks, at fixed offsets:
filling them in and publishing the bytes avoids building, converting and serialising a message at every tick.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

_ENCAPSULATION = b"\x00\x01\x00\x00"  # CDR_LE, no options; alignment counts from its end
_STAMP = struct.Struct("<iI")
_STAMP_AT = len(_ENCAPSULATION)
_NS_PER_S = 1_000_000_000


class JointStateBytes:
    """A sensor_msgs/JointState: empty frame_id, the given names, their positions and velocities, empty effort."""

    def __init__(self, names: Sequence[str]) -> None:
        out = _Writer()
        out.data += _STAMP.pack(0, 0)
        out.string("")
        out.length(len(names))
        for name in names:
            out.string(name)
        self._position_at = out.doubles(len(names))
        self._velocity_at = out.doubles(len(names))
        out.length(0)
        self._data = out.data
        self._row = struct.Struct(f"<{len(names)}d")

    def put(self, position: Sequence[float], velocity: Sequence[float]) -> None:
        """One value per name, rad and rad/s. Raises struct.error for a wrong number of values."""
        self._row.pack_into(self._data, self._position_at, *position)
        self._row.pack_into(self._data, self._velocity_at, *velocity)

    def stamped(self, stamp_ns: int) -> bytes:
        """The message with its present values; 0 is an unset stamp."""
        seconds, nanoseconds = divmod(stamp_ns, _NS_PER_S)
        _STAMP.pack_into(self._data, _STAMP_AT, seconds, nanoseconds)
        return bytes(self._data)


class ArrayBytes:
    """A std_msgs/Float64MultiArray of ``size`` values without a layout."""

    def __init__(self, size: int) -> None:
        out = _Writer()
        out.length(0)  # layout.dim
        out.length(0)  # layout.data_offset
        self._data_at = out.doubles(size)
        self._data = out.data
        self._row = struct.Struct(f"<{size}d")

    def filled(self, values: Sequence[float]) -> bytes:
        """The message with ``values``. Raises struct.error for a wrong number of values."""
        self._row.pack_into(self._data, self._data_at, *values)
        return bytes(self._data)


class _Writer:
    """Appends CDR values, each aligned to its size."""

    def __init__(self) -> None:
        self.data = bytearray(_ENCAPSULATION)

    def length(self, value: int) -> None:
        self._align(4)
        self.data += struct.pack("<I", value)

    def string(self, text: str) -> None:
        """Length with the terminating zero, then the text and the zero."""
        encoded = text.encode() + b"\x00"
        self.length(len(encoded))
        self.data += encoded

    def doubles(self, count: int) -> int:
        """A sequence of ``count`` zeros. Returns the offset of the first one; without elements nothing is aligned."""
        self.length(count)
        if count:
            self._align(8)
        begin = len(self.data)
        self.data += bytes(8 * count)
        return begin

    def _align(self, size: int) -> None:
        self.data += bytes(-(len(self.data) - len(_ENCAPSULATION)) % size)
