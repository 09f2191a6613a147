"""The wire between clients and the engine: frames of JSON, no socket in here.

A frame is a little-endian 32-bit length and that many bytes of UTF-8 JSON. A request is ``[number, method,
argument...]``, its answer ``[number, code, value...]`` with the same number. JSON carries NaN and infinities,
which the engine must reject by name; bytes that are no frame are an error of the sender, which is disconnected.

Long rows of numbers are sent as text, base64 of little-endian float64: a thousand points of a spline as JSON numbers
would delay the engine's cycle by some milliseconds.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

SOCKET_FILE: Final = "engine.sock"
"""In the runtime folder of the engine."""
LARGEST_FRAME: Final = 256 * 1024
_LENGTH: Final = struct.Struct("<I")


class FrameError(Exception):
    """The bytes are no frame of this protocol; the rest of the stream is invalid."""


def encode(message: list[Any]) -> bytes:
    """One frame."""
    body = json.dumps(message, separators=(",", ":")).encode()
    if len(body) > LARGEST_FRAME:
        raise FrameError(f"a frame may have {LARGEST_FRAME} bytes, this has {len(body)}")
    return _LENGTH.pack(len(body)) + body


def pack(numbers: ArrayLike) -> str:
    """Numbers as text, in C order."""
    return base64.b64encode(np.ascontiguousarray(numbers, "<f8").tobytes()).decode()


def unpack(text: str) -> NDArray[np.float64]:
    """The numbers of ``pack`` in one row. Raises ValueError if it is no such text."""
    try:
        numbers = np.frombuffer(binascii.a2b_base64(text, strict_mode=True), "<f8")
    except ValueError as error:
        raise ValueError(f"numbers must be base64 of float64: {error}") from error
    return numbers.astype(np.float64)  # a copy: it must be writable


class Decoder:
    """Cuts a stream of bytes into messages, however the bytes arrive."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[list[Any]]:
        """The messages completed by ``data``. Raises FrameError."""
        self._buffer += data
        messages = []
        while len(self._buffer) >= _LENGTH.size:
            (length,) = _LENGTH.unpack_from(self._buffer)
            if not 0 < length <= LARGEST_FRAME:
                raise FrameError(f"a frame may have 1..{LARGEST_FRAME} bytes, this announces {length}")
            end = _LENGTH.size + length
            if len(self._buffer) < end:
                break
            messages.append(_parse(bytes(self._buffer[_LENGTH.size : end])))
            del self._buffer[:end]
        return messages


def _parse(body: bytes) -> list[Any]:
    try:
        message = json.loads(body)
    except (ValueError, RecursionError) as error:
        raise FrameError(f"a frame's body must be JSON: {error}") from error
    if not isinstance(message, list) or len(message) < 2 or type(message[0]) is not int:
        raise FrameError("a frame's body must be a list that begins with a number")
    return message
