"""The thread that owns a serial port: it opens, reads, and reopens it after a disconnection."""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time
from collections.abc import Callable

import serial

from robot_stack.drivers.serial_params import SerialParams

_CHUNK = 4096


class SerialReader:
    """Starts at once; ``close`` ends it. Callbacks come from its thread.

    port: device path. greeting: sent after each open. on_opened: before the first byte of a line.
    on_bytes: the bytes of one read. ``state`` describes the port's state.
    """

    def __init__(
        self,
        port: str,
        baud_rate: int,
        params: SerialParams,
        greeting: bytes,
        on_opened: Callable[[], None],
        on_bytes: Callable[[bytes], None],
    ) -> None:
        self._port, self._baud_rate, self._params, self._greeting = port, baud_rate, params, greeting
        self._on_opened, self._on_bytes = on_opened, on_bytes
        self.state = f"{port} is not open yet"
        self.opened = 0
        self._wake_read, self._wake_write = os.pipe()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="serial_reader", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Safe to call twice."""
        if not self._closing:
            self._closing = True
            os.write(self._wake_write, b"\0")
        self._thread.join()

    def _run(self) -> None:
        while not self._closing:
            try:
                # Exclusive: a second program on the line would take bytes away.
                with serial.Serial(self._port, self._baud_rate, timeout=0, write_timeout=1, exclusive=True) as line:
                    self._read(line)
            except (OSError, ValueError, serial.SerialException) as error:
                self.state = f"{self._port}: {_reason(error)}"
            self._wait(self._params.reopen_s)

    def _read(self, line: serial.Serial) -> None:
        """Reads until the port is lost (an exception), silent for too long, or closed by us."""
        self._on_opened()
        self.opened += 1
        self.state = f"{self._port} is open"
        line.write(self._greeting)
        heard_s = time.monotonic()
        while not self._closing:
            ready, _, _ = select.select([self._wake_read, line.fileno()], [], [], self._params.silent_s)
            if line.fileno() in ready:
                data = line.read(_CHUNK)
                if data:
                    heard_s = time.monotonic()
                    self._on_bytes(data)
            if time.monotonic() - heard_s >= self._params.silent_s:
                self.state = f"{self._port} is open, but no data arrives"
                return

    def _wait(self, duration_s: float) -> None:
        if not self._closing:
            select.select([self._wake_read], [], [], duration_s)


def _reason(error: Exception) -> str:
    number = getattr(error, "errno", None)
    with contextlib.suppress(TypeError, ValueError):
        return os.strerror(number) if number else str(error)
    return str(error)
