"""Zeroes the padding of serialised messages, which the middleware leaves as it finds it in memory.

Without that, the bytes of a message differ between two runs of the same seed, and so do their digests. The layout is
OMG CDR (DDS-XTYPES 7.4.3.2, XCDR1): a primitive is aligned to its size, counted from behind the four bytes that name
the encoding.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from robot_stack.middleware.interfaces import interface_class

PREFIX = 4
_U32 = struct.Struct("<I")
LENGTH_BYTES = 4
_SIZES = {
    **dict.fromkeys(("boolean", "octet", "byte", "char", "uint8", "int8"), 1),
    **dict.fromkeys(("uint16", "int16"), 2),
    **dict.fromkeys(("uint32", "int32", "float"), 4),
    **dict.fromkeys(("uint64", "int64", "double"), 8),
}
ARRAY = re.compile(r"(.+)\[(\d+)\]")
SEQUENCE = re.compile(r"sequence<(.+?)(?:, \d+)?>")
STRING = re.compile(r"string(<\d+>)?")
_Gaps = list[tuple[int, int]]


class UnknownLayout(ValueError):
    """A message whose bytes do not fit its type."""


@dataclass(slots=True)
class _Fixed:
    """Primitives that stand at fixed places behind the first, which is aligned to ``align``. gaps: begins and ends."""

    align: int
    size: int
    gaps: tuple[tuple[int, int], ...] = ()

    def append(self, size: int, count: int) -> bool:
        """False for a primitive whose place depends on where the first one stands."""
        if size > self.align:
            return False
        pad = -self.size % size
        if pad:
            self.gaps = (*self.gaps, (self.size, self.size + pad))
        self.size += pad + size * count
        return True

    def walk(self, data: bytes, at: int, gaps: _Gaps) -> int:
        pad = -(at - PREFIX) % self.align
        if pad:
            gaps.append((at, at + pad))
            at += pad
        for begin, end in self.gaps:
            gaps.append((at + begin, at + end))
        return at + self.size


class _Text:
    def walk(self, data: bytes, at: int, gaps: _Gaps) -> int:
        at, length = _length(data, at, gaps)
        return at + length


@dataclass(slots=True)
class _Numbers:
    """A sequence of primitives."""

    size: int

    def walk(self, data: bytes, at: int, gaps: _Gaps) -> int:
        at, length = _length(data, at, gaps)
        pad = -(at - PREFIX) % self.size
        if pad and length:
            gaps.append((at, at + pad))
            at += pad
        return at + self.size * length


@dataclass(slots=True)
class _Items:
    """A sequence of structures or texts."""

    steps: list[_Step]

    def walk(self, data: bytes, at: int, gaps: _Gaps) -> int:
        at, length = _length(data, at, gaps)
        for _ in range(length):
            for step in self.steps:
                at = step.walk(data, at, gaps)
        return at


_Step = _Fixed | _Text | _Numbers | _Items


def _length(data: bytes, at: int, gaps: _Gaps) -> tuple[int, int]:
    pad = -(at - PREFIX) % LENGTH_BYTES
    if pad:
        gaps.append((at, at + pad))
        at += pad
    return at + LENGTH_BYTES, _U32.unpack_from(data, at)[0]


@cache
def zero_padding(type_name: str) -> Callable[[bytes], bytes]:
    """What sets the padding of serialised messages of this type to zero. It raises UnknownLayout.

    The bytes are returned as they are where nothing has to change.
    """
    steps: list[_Step] = []
    _add(steps, type_name)

    def zeroed(data: bytes) -> bytes:
        gaps: _Gaps = []
        at = PREFIX
        try:
            for step in steps:
                at = step.walk(data, at, gaps)
        except struct.error as error:
            raise UnknownLayout(f"a {type_name} of {len(data)} bytes ends within its fields") from error
        if at > len(data):
            raise UnknownLayout(f"a {type_name} of {len(data)} bytes has {at} bytes of fields")
        if at < len(data):
            # rmw_fastrtps sizes the buffer by an estimate, which counts padding also for empty sequences.
            gaps.append((at, len(data)))
        changed: bytearray | None = None
        for begin, end in gaps:
            if any(data[begin:end]):
                if changed is None:
                    changed = bytearray(data)
                changed[begin:end] = bytes(end - begin)
        return data if changed is None else bytes(changed)

    return zeroed


def _add(steps: list[_Step], type_name: str) -> None:
    """Adds the fields of a message."""
    fields = interface_class(type_name).get_fields_and_field_types()
    if not fields:  # an empty structure has one hidden octet
        _add_field(steps, "octet")
    for field in fields.values():
        _add_field(steps, field)


def _add_field(steps: list[_Step], field: str, count: int = 1) -> None:
    if field in _SIZES:
        last = steps[-1] if steps else None
        if not (isinstance(last, _Fixed) and last.append(_SIZES[field], count)):
            steps.append(_Fixed(_SIZES[field], _SIZES[field] * count))
    elif array := ARRAY.fullmatch(field):
        if array[1] in _SIZES:
            _add_field(steps, array[1], int(array[2]))
        else:
            for _ in range(int(array[2])):
                _add_field(steps, array[1])
    elif sequence := SEQUENCE.fullmatch(field):
        if sequence[1] in _SIZES:
            steps.append(_Numbers(_SIZES[sequence[1]]))
        else:
            inner: list[_Step] = []
            _add_field(inner, sequence[1])
            steps.append(_Items(inner))
    elif STRING.fullmatch(field):
        steps.append(_Text())
    elif "/" in field:
        package, name = field.split("/")
        _add(steps, f"{package}/msg/{name}")
    else:
        raise UnknownLayout(f"the layout of a field of type {field} is not known")
