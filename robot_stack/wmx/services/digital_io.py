"""Digital inputs and outputs by byte and bit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from robot_stack.wmx.api import MAX_IO_BYTES, ErrorCode
from robot_stack.wmx.api.port import Io
from robot_stack.wmx.general.answers import Answer, failure

Image = Literal["input", "output"]
_BITS = 8


@dataclass(frozen=True, slots=True)
class BitRead:
    """value: 0 without success."""

    answer: Answer
    value: int = 0


@dataclass(frozen=True, slots=True)
class BytesRead:
    """data: empty without success."""

    answer: Answer
    data: bytes = b""


def read_bit(io: Io, image: Image, byte: int, bit: int) -> BitRead:
    """One bit of the input or output image."""
    name = f"{image} bit {byte}.{bit}"
    bad = _bad_byte(byte) or _bad_bit(bit)
    if bad:
        return BitRead(Answer(False, f"Failed to read {name}: {bad}"))
    code, value = io.GetInBit(byte, bit) if image == "input" else io.GetOutBit(byte, bit)
    if code:
        return BitRead(failure(f"Failed to read {name}", code, io.ErrorToString))
    return BitRead(Answer(True, f"{name.capitalize()} is {value}"), value)


def read_bytes(io: Io, image: Image, byte: int, length: int) -> BytesRead:
    """Some bytes of the input or output image."""
    name = f"{length} {image} bytes from {byte}"
    bad = _bad_byte(byte) or _bad_length(length)
    if bad:
        return BytesRead(Answer(False, f"Failed to read {name}: {bad}"))
    code, values = io.GetInBytes(byte, length) if image == "input" else io.GetOutBytes(byte, length)
    if not code and len(values) != length:
        code = ErrorCode.IOSizeOutOfRange
    if code:
        return BytesRead(failure(f"Failed to read {name}", code, io.ErrorToString))
    return BytesRead(Answer(True, f"Read {name}"), bytes(values))


def write_bit(io: Io, byte: int, bit: int, value: int) -> Answer:
    """One bit of the output image."""
    name = f"output bit {byte}.{bit} to {value}"
    bad = _bad_byte(byte) or _bad_bit(bit) or ("" if value in (0, 1) else f"value must be 0 or 1, is {value}")
    return _write(name, bad, lambda: io.SetOutBit(byte, bit, value), io)


def write_bytes(io: Io, byte: int, data: bytes) -> Answer:
    """Some bytes of the output image, all or none."""
    name = f"{len(data)} output bytes from {byte}"
    bad = _bad_byte(byte) or _bad_length(len(data))
    return _write(name, bad, lambda: io.SetOutBytes(byte, len(data), list(data)), io)


def _write(name: str, bad: str, request: Callable[[], int], io: Io) -> Answer:
    if bad:
        return Answer(False, f"Failed to set {name}: {bad}")
    code = request()
    return failure(f"Failed to set {name}", code, io.ErrorToString) if code else Answer(True, f"Set {name}")


def _bad_byte(byte: int) -> str:
    return "" if 0 <= byte < MAX_IO_BYTES else f"byte must be in 0..{MAX_IO_BYTES - 1}, is {byte}"


def _bad_bit(bit: int) -> str:
    return "" if 0 <= bit < _BITS else f"bit must be in 0..{_BITS - 1}, is {bit}"


def _bad_length(length: int) -> str:
    return "" if 0 < length <= MAX_IO_BYTES else f"length must be in 1..{MAX_IO_BYTES}, is {length}"
