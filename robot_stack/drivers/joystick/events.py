"""Events of the kernel's joystick interface (linux/joystick.h): 8 bytes each: time in ms, value, type, number."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

FULL: Final = 32767  # of an axis
_EVENT: Final = struct.Struct("<IhBB")
_BUTTON, _AXIS, _INITIAL = 0x01, 0x02, 0x80


class EventRefused(Exception):
    """The data is not an event. The message is one line."""


@dataclass(frozen=True, slots=True)
class Event:
    """number: of the button or axis. value: 1 or 0 of a button, [-1, 1] of an axis.

    initial: not a movement, but the state at the opening of the device.
    """

    button: bool
    number: int
    value: float
    initial: bool


class Decoder:
    """Takes bytes as they come."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[Event]:
        """The complete events. Raises EventRefused; then reopen the device."""
        data = self._rest + data
        whole = len(data) - len(data) % _EVENT.size
        self._rest = data[whole:]
        return [_event(*fields) for fields in _EVENT.iter_unpack(data[:whole])]


def _event(_: int, value: int, kind: int, number: int) -> Event:
    button, initial = kind & ~_INITIAL == _BUTTON, bool(kind & _INITIAL)
    if not button and kind & ~_INITIAL != _AXIS:
        raise EventRefused(f"an event is of type 0x{kind:02X}, expected a button or an axis")
    if button and value not in (0, 1):
        raise EventRefused(f"button {number} is {value}, expected 0 or 1")
    return Event(button, number, float(value) if button else max(-1.0, value / FULL), initial)
