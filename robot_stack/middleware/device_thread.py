"""A thread that owns a device: it opens and uses the device, reports the problem of a loss, and reopens it."""

from __future__ import annotations

import contextlib
import logging
import os
import select
import threading
import time
from collections.abc import Callable
from typing import Protocol

_log = logging.getLogger(__name__)


class DeviceLost(Exception):
    """The device cannot be used or is lost. The message continues the name of the device, e.g. "sends no frames"."""


class HasFileno(Protocol):
    """A file, socket or serial port."""

    def fileno(self) -> int: ...


class Device(Protocol):
    """where: the device in words."""

    @property
    def where(self) -> str: ...

    def use(self, thread: DeviceThread) -> None:
        """Opens the device, calls ``thread.report_open``, uses it while ``thread.running``, and closes it.

        Raises DeviceLost or an exception of the device's library if the device cannot be opened or is lost. ``close``
        of the thread takes as long as the longest blocking call between two looks at ``thread.running``.
        """
        ...


class DeviceThread:
    """Calls ``use`` of the device, again ``reopen_s`` after each loss. Starts at once; ``close`` ends it.

    reopen_s: a pause, or a function that returns the next one.
    state: of the device in words. opened: number of times that the device was opened.
    """

    def __init__(self, device: Device, reopen_s: float | Callable[[], float]) -> None:
        self._device, self._reopen_s = device, reopen_s
        self._open = f"{device.where} is open"
        self.state = f"{device.where} is not open yet"
        self.opened = 0
        self.running = True
        self._logged = ""
        self._wake = os.eventfd(0, os.EFD_NONBLOCK)
        self._thread = threading.Thread(target=self._run, name=type(device).__name__, daemon=True)
        self._thread.start()

    @property
    def is_open(self) -> bool:
        return self.state == self._open

    def problem(self, of_data: str) -> str:
        """Why no data arrive. of_data: why those of the open device are not used; empty if none arrive."""
        return of_data if of_data and self.is_open else self.state

    def close(self) -> None:
        """Safe to call twice."""
        if self.running:
            self.running = False
            os.eventfd_write(self._wake, 1)
            self._thread.join()
            os.close(self._wake)

    def wake(self) -> None:
        """Ends ``wait``. Without effect after ``close``, called from the same thread."""
        if self.running:
            os.eventfd_write(self._wake, 1)

    # --- in the thread -----------------------------------------------------------------------------------------------

    def report_open(self) -> None:
        self.opened += 1
        self.state = self._open

    def wait(self, duration_s: float | None, file: HasFileno | int | None = None) -> bool:
        """True if ``file`` has data; False after ``duration_s`` (None: unlimited), or once ``wake`` was called."""
        ready, _, _ = select.select([self._wake, *([] if file is None else [file])], [], [], duration_s)
        if self._wake in ready:
            os.eventfd_read(self._wake)
        return file in ready

    def _run(self) -> None:
        while self.running:
            try:
                self._device.use(self)
            except DeviceLost as lost:
                self.state = f"{self._device.where} {lost}"
            except (OSError, ValueError) as error:
                self.state = f"{self._device.where}: {reason(error)}"
            except Exception as error:  # a library's own, or a defect: without a thread the device would stay lost
                self.state = f"{self._device.where}: {type(error).__name__}: {error}"
                if self.state != self._logged:
                    self._logged = self.state
                    _log.exception("%s; the device is reopened", self.state)
            self._pause()

    def _pause(self) -> None:
        end_s = time.monotonic() + (self._reopen_s() if callable(self._reopen_s) else self._reopen_s)
        while self.running and (left_s := end_s - time.monotonic()) > 0.0:
            self.wait(left_s)


def reason(error: Exception) -> str:
    """The text of an error; of one of the operating system without number and path."""
    number = getattr(error, "errno", None)
    with contextlib.suppress(TypeError, ValueError):
        return os.strerror(number) if number else str(error)
    return str(error)
