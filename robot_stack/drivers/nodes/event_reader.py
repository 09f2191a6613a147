"""The thread that owns a device file of events: it opens, reads, and reopens it after a disconnection."""

from __future__ import annotations

import os
import select
import threading
from collections.abc import Callable

_CHUNK = 4096


class EventReader:
    """Starts at once; ``close`` ends it. Callbacks come from its thread.

    on_bytes: the bytes of one read. on_lost: the open device was disconnected.
    """

    def __init__(
        self, device: str, reopen_s: float, on_bytes: Callable[[bytes], None], on_lost: Callable[[], None]
    ) -> None:
        self._device, self._reopen_s, self._on_bytes, self._on_lost = device, reopen_s, on_bytes, on_lost
        self.state = f"{device} is not open yet"
        self._wake_read, self._wake_write = os.pipe()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="event_reader", daemon=True)
        self._thread.start()

    def open_anew(self) -> None:
        """Reopens the device: its data is invalid."""
        os.write(self._wake_write, b"\0")

    def close(self) -> None:
        """Safe to call twice."""
        if not self._closing:
            self._closing = True
            os.write(self._wake_write, b"\0")
        self._thread.join()

    def _run(self) -> None:
        while not self._closing:
            try:
                file = os.open(self._device, os.O_RDONLY | os.O_NONBLOCK)
            except OSError as error:
                self.state = f"{self._device}: {error.strerror}"
            else:
                self._read(file)
                os.close(file)
                self._on_lost()
            if select.select([self._wake_read], [], [], self._reopen_s)[0]:
                os.read(self._wake_read, _CHUNK)

    def _read(self, file: int) -> None:
        """Reads until the device is lost or is to be reopened."""
        self.state = f"{self._device} is open"
        while not self._closing:
            woken, _, _ = select.select([self._wake_read, file], [], [])
            if self._wake_read in woken:
                self.state = f"{self._device} is reopened"
                return
            try:
                data = os.read(file, _CHUNK)
            except BlockingIOError:
                continue
            except OSError as error:
                self.state = f"{self._device}: {error.strerror}"
                return
            if not data:
                self.state = f"{self._device} has ended"
                return
            self._on_bytes(data)
