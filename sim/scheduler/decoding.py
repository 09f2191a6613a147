"""Deserialises messages, five times as fast as the middleware.

``rclpy`` constructs every nested message with its default values and looks its class up by name each time. Here the
classes and the layout (OMG CDR, DDS-XTYPES 7.4.3.2, XCDR1: a primitive is aligned to its size, counted from behind the
four bytes that name the encoding) are prepared once per type. Equality with the
middleware's result is tested for every type of the contract; types with unsupported fields are left to it.
"""

from __future__ import annotations

import array
import os
import re
import struct
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from robot_stack.middleware.interfaces import interface_class
from robot_stack.ros.serialization import deserialize_message

_PREFIX = 4
_LENGTH_BYTES = 4
_ARRAY = re.compile(r"(.+)\[(\d+)\]")
_SEQUENCE = re.compile(r"sequence<(.+?)(?:, \d+)?>")
_STRING = re.compile(r"string(<\d+>)?")
_LITTLE_ENDIAN = b"\x00\x01"
_U32 = struct.Struct("<I")
# By type: size, code of struct, code of array.array.
_NUMBERS = {
    "boolean": (1, "?", ""),
    "octet": (1, "c", ""),
    "int8": (1, "b", "b"),
    "uint8": (1, "B", "B"),
    "int16": (2, "h", "h"),
    "uint16": (2, "H", "H"),
    "int32": (4, "i", "i"),
    "uint32": (4, "I", "I"),
    "int64": (8, "q", "q"),
    "uint64": (8, "Q", "Q"),
    "float": (4, "f", "f"),
    "double": (8, "d", "d"),
}


class UnknownLayout(ValueError):
    """A message whose bytes do not fit its type."""


# Returns a value and where the next one may begin.
_Read = Callable[[bytes, int], tuple[Any, int]]
# Sets fields of a message and returns where the next one may begin.
_Step = Callable[[Any, bytes, int], int]


@cache
def decoder(type_name: str) -> Callable[[bytes], Any]:
    """The decoder of this type's bytes. For invalid bytes it raises the middleware's exception."""
    message_class = interface_class(type_name)
    try:
        read = _message(type_name)
    except UnknownLayout:
        return lambda data: deserialize_message(data, message_class)

    def decode(data: bytes) -> Any:
        if data[:2] == _LITTLE_ENDIAN:
            try:
                return read(data, _PREFIX)[0]
            except (struct.error, ValueError):  # left to the middleware, which reports the error
                pass
        return deserialize_message(data, message_class)

    return decode


@cache
def _message(type_name: str) -> _Read:
    message_class = interface_class(type_name)
    fields = message_class.get_fields_and_field_types()
    steps = tuple(_steps(list(fields.items())))
    checks = os.environ.get("ROS_PYTHON_CHECK_FIELDS", "") == "1"  # as the generated classes
    has_checks = "_check_fields" in message_class.__slots__
    if not fields:
        raise UnknownLayout(f"{type_name} has no fields")
    new = message_class.__new__

    def read(data: bytes, at: int) -> tuple[Any, int]:
        message = new(message_class)
        if has_checks:
            message._check_fields = checks
        for step in steps:
            at = step(message, data, at)
        return message, at

    return read


def _steps(fields: list[tuple[str, str]]) -> list[_Step]:
    """Neighbouring numbers are read together."""
    steps: list[_Step] = []
    run: list[tuple[str, str]] = []
    for name, kind in fields:
        if kind in _NUMBERS and not (run and _NUMBERS[kind][0] > _NUMBERS[run[0][1]][0]):
            run.append((name, kind))
            continue
        if run:
            steps.append(_run(run))
            run = []
        if kind in _NUMBERS:
            run = [(name, kind)]
        else:
            steps.append(_field(f"_{name}", _value(kind)))
    if run:
        steps.append(_run(run))
    return steps


def _run(fields: list[tuple[str, str]]) -> _Step:
    """Numbers of which the first has the greatest alignment, so that the places of the others are known."""
    align, code, size = _NUMBERS[fields[0][1]][0], "<", 0
    for _, kind in fields:
        one, letter, _ = _NUMBERS[kind]
        pad = -size % one
        code, size = f"{code}{'x' * pad}{letter}", size + pad + one
    unpack, names = struct.Struct(code).unpack_from, tuple(f"_{name}" for name, _ in fields)
    if len(names) == 1:
        (only,) = names

        def set_one(message: Any, data: bytes, at: int) -> int:
            at += -(at - _PREFIX) % align
            setattr(message, only, unpack(data, at)[0])
            return at + size

        return set_one

    def set_all(message: Any, data: bytes, at: int) -> int:
        at += -(at - _PREFIX) % align
        for name, value in zip(names, unpack(data, at), strict=True):
            setattr(message, name, value)
        return at + size

    return set_all


def _field(name: str, read: _Read) -> _Step:
    def set_field(message: Any, data: bytes, at: int) -> int:
        value, at = read(data, at)
        setattr(message, name, value)
        return at

    return set_field


def _value(kind: str) -> _Read:
    if _STRING.fullmatch(kind):
        return _text
    if found := _ARRAY.fullmatch(kind):
        return _array(found[1], int(found[2]))
    if found := _SEQUENCE.fullmatch(kind):
        return _sequence(found[1])
    if "/" in kind:
        package, name = kind.split("/")
        return _message(f"{package}/msg/{name}")
    raise UnknownLayout(f"the layout of a field of type {kind} is not known")


def _text(data: bytes, at: int) -> tuple[str, int]:
    at += -(at - _PREFIX) % _LENGTH_BYTES
    begin = at + _LENGTH_BYTES
    end = begin + _U32.unpack_from(data, at)[0]
    if end > len(data):
        raise ValueError("the message ends within a text")
    return data[begin : end - 1].decode(errors="replace"), end


def _array(kind: str, count: int) -> _Read:
    if "/" in kind:
        return _items(_value(kind), count)
    size, _, letter = _NUMBERS.get(kind, (0, "", ""))
    if not letter:
        raise UnknownLayout(f"the layout of an array of {kind} is not known")
    dtype = np.dtype(f"<{letter}")

    def read(data: bytes, at: int) -> tuple[Any, int]:
        at += -(at - _PREFIX) % size
        return np.frombuffer(data, dtype, count, at).copy(), at + size * count

    return read


def _sequence(kind: str) -> _Read:
    if kind == "boolean":
        return _booleans
    if kind in _NUMBERS:
        return _numbers(*_NUMBERS[kind])
    return _items(_value(kind), None)


def _items(read_item: _Read, fixed: int | None) -> _Read:
    """A list of messages or texts. fixed: of an array, how many; a sequence begins with that."""

    def read(data: bytes, at: int) -> tuple[list[Any], int]:
        items = []
        count = fixed
        if count is None:
            at += -(at - _PREFIX) % _LENGTH_BYTES
            count = int(_U32.unpack_from(data, at)[0])
            at += _LENGTH_BYTES
        for _ in range(count):
            item, at = read_item(data, at)
            items.append(item)
        return items, at

    return read


def _booleans(data: bytes, at: int) -> tuple[list[bool], int]:
    at += -(at - _PREFIX) % _LENGTH_BYTES
    begin = at + _LENGTH_BYTES
    end = begin + _U32.unpack_from(data, at)[0]
    if end > len(data):
        raise ValueError("the message ends within a sequence")
    return [item != 0 for item in data[begin:end]], end


def _numbers(size: int, _: str, letter: str) -> _Read:
    if not letter:
        raise UnknownLayout("the layout of a sequence of octets is not known")

    def read(data: bytes, at: int) -> tuple[array.array[Any], int]:
        at += -(at - _PREFIX) % _LENGTH_BYTES
        (count,) = _U32.unpack_from(data, at)
        at += _LENGTH_BYTES
        values = array.array(letter)
        if count:
            at += -(at - _PREFIX) % size
            end = at + size * count
            if end > len(data):
                raise ValueError("the message ends within a sequence")
            values.frombytes(data[at:end])
            at = end
        return values, at

    return read
