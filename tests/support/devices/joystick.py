"""A joystick like the kernel's: a file of events, here a named pipe."""

from __future__ import annotations

import os
import struct
from pathlib import Path

_BUTTON, _AXIS, _INITIAL = 0x01, 0x02, 0x80


def button(number: int, pressed: bool, initial: bool = False) -> bytes:
    return struct.pack("<IhBB", 0, int(pressed), _BUTTON | (_INITIAL if initial else 0), number)


def axis(number: int, value: float, initial: bool = False) -> bytes:
    """value: [-1, 1]."""
    return struct.pack("<IhBB", 0, round(32767 * value), _AXIS | (_INITIAL if initial else 0), number)


class Joystick:
    """link: the device file. Begins unplugged."""

    def __init__(self, link: Path) -> None:
        self._link = link
        self._end: int | None = None

    def plug(self) -> None:
        """Creates the file, whose readers receive the sent events; does nothing if it exists."""
        if self._end is None:
            os.mkfifo(self._link)
            # Both ways: a write-only pipe cannot be opened before there is a reader.
            self._end = os.open(self._link, os.O_RDWR | os.O_NONBLOCK)

    def pull(self) -> None:
        """The file is gone, and who has it open reads its end."""
        if self._end is not None:
            self._link.unlink()
            os.close(self._end)
            self._end = None

    def send(self, *events: bytes) -> None:
        if self._end is not None:
            os.write(self._end, b"".join(events))
