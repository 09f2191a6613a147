"""A serial line on which a device sends bytes."""

from __future__ import annotations

from collections.abc import Callable

import serial

from robot_stack.drivers.serial_params import SerialParams
from robot_stack.middleware.device_thread import DeviceLost, DeviceThread

_CHUNK = 4096


class SerialLine:
    """Callbacks come from the device's thread.

    clock: the node's ``device_s``, for its silence.
    port: device path. greeting: sent after each open. on_opened: before the first byte of a line.
    on_bytes: the bytes of one read.
    """

    def __init__(
        self,
        clock: Callable[[], float],
        port: str,
        baud_rate: int,
        params: SerialParams,
        greeting: bytes,
        on_opened: Callable[[], None],
        on_bytes: Callable[[bytes], None],
    ) -> None:
        self._clock = clock
        self.where, self._baud_rate, self._params, self._greeting = port, baud_rate, params, greeting
        self._on_opened, self._on_bytes = on_opened, on_bytes

    def use(self, thread: DeviceThread) -> None:
        # Exclusive: a second program on the line would take bytes away.
        with serial.Serial(self.where, self._baud_rate, timeout=0, write_timeout=1, exclusive=True) as line:
            self._on_opened()
            thread.report_open()
            line.write(self._greeting)
            self._read(line, thread)

    def _read(self, line: serial.Serial, thread: DeviceThread) -> None:
        received_s = self._clock()
        while thread.running:
            data = line.read(_CHUNK) if thread.wait(self._params.silent_s, line) else b""
            if data:
                received_s = self._clock()
                self._on_bytes(data)
            elif self._clock() - received_s >= self._params.silent_s:
                raise DeviceLost("is open, but no data arrives")
