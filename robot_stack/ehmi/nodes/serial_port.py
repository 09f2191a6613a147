"""The thread that owns the serial port: it opens, reads and writes as the link commands. No other thread blocks on it.

It runs on the machine's steady clock, also if the nodes run on simulated time: the display does too.
"""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time

import serial

from robot_stack.ehmi.link import Link, LinkStatus, Shown
from robot_stack.ehmi.params import LinkParams

_CHUNK = 4096
_LONGEST_WAIT_S = 1.0


class SerialPort:
    """port: device path. Starts at once; ``close`` ends it.

    ``show`` and ``status`` may be called from any thread and do not block.
    """

    def __init__(self, port: str, baud_rate: int, params: LinkParams, wanted: Shown) -> None:
        self._port, self._baud_rate = port, baud_rate
        self._link = Link(params, wanted)
        self._turn = threading.Lock()  # held for microseconds, never around an operation of the port
        self._serial: serial.Serial | None = None
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_read, False)
        os.set_blocking(self._wake_write, False)
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="ehmi_serial", daemon=True)
        self._thread.start()

    def show(self, wanted: Shown) -> None:
        """Raises ValueError for a setting that the display does not have."""
        with self._turn:
            self._link.show(wanted, time.monotonic())
        self._wake()

    def status(self) -> LinkStatus:
        with self._turn:
            return self._link.status

    def rejected(self) -> dict[str, int]:
        """Number of rejected lines of the display, by reason."""
        with self._turn:
            return self._link.rejected

    def close(self) -> None:
        """Safe to call twice."""
        self._closing = True
        self._wake()
        self._thread.join()

    def _wake(self) -> None:
        with contextlib.suppress(BlockingIOError):  # a full pipe wakes as well
            os.write(self._wake_write, b"\0")

    # --- the thread --------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            while not self._closing:
                self._act()
                self._wait()
        finally:
            self._drop_port()

    def _act(self) -> None:
        now_s = time.monotonic()
        with self._turn:
            order = self._link.step(now_s)
        if order.close:
            self._drop_port()
        if order.open:
            self._open()
        if order.data and self._serial is not None:
            try:
                # Bytes beyond a full output buffer are lost, as on a wire; the link sends again.
                self._serial.write(order.data)
            except (OSError, serial.SerialException) as error:
                self._lost(error)

    def _wait(self) -> None:
        with self._turn:
            due_s = self._link.next_due_s()
        timeout_s = min(max(0.0, due_s - time.monotonic()), _LONGEST_WAIT_S)
        readers = [self._wake_read, *([self._serial.fileno()] if self._serial is not None else [])]
        ready, _, _ = select.select(readers, [], [], timeout_s)
        if self._wake_read in ready:
            with contextlib.suppress(BlockingIOError):
                os.read(self._wake_read, _CHUNK)
        if self._serial is not None and self._serial.fileno() in ready:
            self._read(self._serial)

    def _read(self, port: serial.Serial) -> None:
        try:
            data = port.read(_CHUNK)
        except (OSError, serial.SerialException) as error:
            self._lost(error)
            return
        with self._turn:
            self._link.received(data, time.monotonic())

    def _open(self) -> None:
        try:
            # Non-blocking both ways; exclusive: a second program on the line would take answers away.
            self._serial = serial.Serial(self._port, self._baud_rate, timeout=0, write_timeout=0, exclusive=True)
        except (OSError, ValueError) as error:
            with self._turn:
                self._link.lost(f"{self._port} cannot be opened: {_reason(error)}", time.monotonic())
            return
        with self._turn:
            self._link.opened(time.monotonic())

    def _lost(self, error: Exception) -> None:
        self._drop_port()
        with self._turn:
            self._link.lost(f"{self._port} is disconnected: {_reason(error)}", time.monotonic())

    def _drop_port(self) -> None:
        if self._serial is not None:
            with contextlib.suppress(OSError):
                self._serial.close()
            self._serial = None


def _reason(error: Exception) -> str:
    number = getattr(error, "errno", None)
    return os.strerror(number) if number else str(error)
