"""The serial port of the display: opens it, reads and writes as the link commands. No other thread blocks on it.

It runs on the machine's steady clock, also if the nodes run on simulated time: the display does too.
"""

from __future__ import annotations

import contextlib
import threading
import time

import serial

from robot_stack.ehmi.link import Link, LinkStatus, Shown
from robot_stack.ehmi.params import LinkParams
from robot_stack.middleware.device_thread import DeviceThread, reason

_CHUNK = 4096
_LONGEST_WAIT_S = 1.0


class SerialPort:
    """port: device path. Starts at once; ``close`` ends it.

    ``show`` and ``status`` may be called from any thread and do not block.
    """

    def __init__(self, port: str, baud_rate: int, params: LinkParams, wanted: Shown) -> None:
        self.where, self._baud_rate = port, baud_rate
        self._link = Link(params, wanted)
        self._turn = threading.Lock()  # held for microseconds, never around an operation of the port
        self._serial: serial.Serial | None = None
        self._thread = DeviceThread(self, params.back_off_s)

    def show(self, wanted: Shown) -> None:
        """Raises ValueError for a setting that the display does not have."""
        with self._turn:
            self._link.show(wanted, time.monotonic())
        self._thread.wake()

    def status(self) -> LinkStatus:
        with self._turn:
            return self._link.status

    def rejected(self) -> dict[str, int]:
        """Number of rejected lines of the display, by reason."""
        with self._turn:
            return self._link.rejected

    def close(self) -> None:
        """Safe to call twice."""
        self._thread.close()

    # --- the thread --------------------------------------------------------------------------------------------------

    def use(self, thread: DeviceThread) -> None:
        """Runs until ``close``: the link, which also reopens a port without answers, sets the pauses of a reopening."""
        try:
            while thread.running:
                try:
                    self._act()
                    self._wait(thread)
                except Exception as error:
                    problem = "cannot be opened" if self._serial is None else "is disconnected"
                    self._drop_port()
                    with self._turn:
                        self._link.lost(f"{self.where} {problem}: {reason(error)}", time.monotonic())
                    if not isinstance(error, (OSError, ValueError)):
                        raise
        finally:
            self._drop_port()

    def _act(self) -> None:
        with self._turn:
            order = self._link.step(time.monotonic())
        if order.close:
            self._drop_port()
        if order.open:
            # Non-blocking both ways; exclusive: a second program on the line would take answers away.
            self._serial = serial.Serial(self.where, self._baud_rate, timeout=0, write_timeout=0, exclusive=True)
            with self._turn:
                self._link.opened(time.monotonic())
        if order.data and self._serial is not None:
            # Bytes beyond a full output buffer are lost, as on a wire; the link sends again.
            self._serial.write(order.data)

    def _wait(self, thread: DeviceThread) -> None:
        with self._turn:
            due_s = self._link.next_due_s()
        if thread.wait(min(max(0.0, due_s - time.monotonic()), _LONGEST_WAIT_S), self._serial):
            assert self._serial is not None
            data = self._serial.read(_CHUNK)
            with self._turn:
                self._link.received(data, time.monotonic())

    def _drop_port(self) -> None:
        if self._serial is not None:
            with contextlib.suppress(OSError):
                self._serial.close()
            self._serial = None
