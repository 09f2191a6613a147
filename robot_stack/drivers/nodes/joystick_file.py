"""The device file of a joystick."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Sequence

from robot_stack.drivers.joystick.events import Decoder, Event, EventRefused
from robot_stack.middleware.device_thread import DeviceLost, DeviceThread

_CHUNK = 4096


class JoystickFile:
    """Callbacks come from the device's thread. on_events: the events of one read. on_lost: the open device was lost.

    A device with invalid events is reopened.
    """

    def __init__(self, device: str, on_events: Callable[[Sequence[Event]], None], on_lost: Callable[[], None]) -> None:
        self.where, self._on_events, self._on_lost = device, on_events, on_lost

    def use(self, thread: DeviceThread) -> None:
        file = os.open(self.where, os.O_RDONLY | os.O_NONBLOCK)
        thread.report_open()
        try:
            self._read(file, thread)
        finally:
            os.close(file)
            self._on_lost()

    def _read(self, file: int, thread: DeviceThread) -> None:
        decoder = Decoder()
        while thread.running:
            if not thread.wait(None, file):
                continue
            with contextlib.suppress(BlockingIOError):
                data = os.read(file, _CHUNK)
                if not data:
                    raise DeviceLost("has ended")
                try:
                    events = decoder.feed(data)
                except EventRefused as refusal:
                    raise DeviceLost(f"is reopened: {refusal}") from refusal
                self._on_events(events)
