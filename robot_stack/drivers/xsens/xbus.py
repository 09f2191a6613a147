"""Frames of the Xbus protocol in a stream of bytes (Xsens, MT Low Level Communication Protocol, MT0101P).

0xFA, bus 0xFF, message id, length (0xFF: two more bytes of length), data, checksum: all bytes behind 0xFA add up to 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from robot_stack.drivers.counters import Counters

PREAMBLE: Final = 0xFA
BUS: Final = 0xFF
GO_TO_MEASUREMENT: Final = 0x10
ERROR: Final = 0x42
MTDATA2: Final = 0x36
_EXTENDED, _LONGEST = 0xFF, 2048
CORRUPT, SKIPPED = "frames corrupt", "bytes skipped"


@dataclass(frozen=True, slots=True)
class Message:
    id: int
    data: bytes


def encode(message: Message) -> bytes:
    """The frame of a message. Raises ValueError for more data than a frame holds."""
    size = len(message.data)
    if size > _LONGEST:
        raise ValueError(f"{size} bytes do not fit into a frame, which holds {_LONGEST}")
    length = bytes([size]) if size < _EXTENDED else bytes([_EXTENDED, *divmod(size, 256)])
    body = bytes([BUS, message.id]) + length + message.data
    return bytes([PREAMBLE]) + body + bytes([-sum(body) % 256])


class Decoder:
    """Accepts bytes in any pieces: partial frames, garbage between and within them, frames with a wrong checksum."""

    def __init__(self, counters: Counters) -> None:
        self._buffer = bytearray()
        self._counters = counters

    def feed(self, data: bytes) -> list[Message]:
        """The messages that are whole now."""
        self._buffer += data
        found: list[Message] = []
        while self._take(found):
            pass
        return found

    def restart(self) -> None:
        """Drops an incomplete frame: the line was opened in between."""
        self._buffer.clear()

    def _take(self, found: list[Message]) -> bool:
        """Reads one frame, or skips a byte that begins none. False: no complete frame is left."""
        buffer = self._buffer
        start = buffer.find(PREAMBLE)
        self._skip(len(buffer) if start < 0 else start)
        if len(buffer) < 4:
            # Two bytes are enough to see that this is no frame.
            return self._skip(1) if len(buffer) >= 2 and buffer[1] != BUS else False
        extended = buffer[3] == _EXTENDED
        if buffer[1] != BUS or (extended and len(buffer) >= 6 and not _fits(buffer)):
            return self._skip(1)
        begin = 6 if extended else 4
        if len(buffer) < begin:
            return False
        end = begin + (int.from_bytes(buffer[4:6], "big") if extended else buffer[3])
        if len(buffer) <= end:
            return False
        if sum(buffer[1 : end + 1]) % 256:
            self._counters.add(CORRUPT)
            return self._skip(1)  # the next frame may begin within this one
        found.append(Message(buffer[2], bytes(buffer[begin:end])))
        del buffer[: end + 1]
        return True

    def _skip(self, count: int) -> bool:
        if count:
            del self._buffer[:count]
            self._counters.add(SKIPPED, count)
        return True


def _fits(buffer: bytearray) -> bool:
    return _EXTENDED <= int.from_bytes(buffer[4:6], "big") <= _LONGEST
