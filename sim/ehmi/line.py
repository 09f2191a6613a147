"""The line: a pseudo terminal with the firmware at its end, under a name that is constant over reconnections."""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from sim.devices.serial_line import SerialLine
from sim.ehmi.firmware import Display, Firmware
from sim.ehmi.params import FirmwareParams

ResultT = TypeVar("ResultT")
_CHUNK = 4096
_LONGEST_WAIT_S = 0.5


class DisplayLine:
    """A powered display on a plugged cable, in a thread of its own; ``close`` ends it.

    link: the path under which the terminal is found. Real time: a microcontroller knows no other.
    """

    def __init__(self, params: FirmwareParams, link: Path) -> None:
        self._firmware = Firmware(params)
        self._line = SerialLine(link)
        self._turn = threading.Lock()
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_read, False)
        self._closing = False
        self._firmware.power_on(time.monotonic())
        self.plug()
        self._thread = threading.Thread(target=self._run, name="ehmi_display", daemon=True)
        self._thread.start()

    @property
    def time_s(self) -> float:
        return time.monotonic()

    def with_firmware(self, act: Callable[[Firmware, float], ResultT]) -> ResultT:
        """Calls ``act(firmware, now)`` with exclusive access to the firmware."""
        with self._turn:
            result = act(self._firmware, time.monotonic())
        self._wake()
        return result

    def display(self) -> Display:
        return self.with_firmware(lambda firmware, now_s: firmware.display(now_s))

    def plug(self) -> None:
        """Connects the cable: the terminal appears."""
        with self._turn:
            self._line.plug()
        self._wake()

    def pull(self) -> None:
        """Disconnects the cable: a process with the open terminal gets a hang-up. The display keeps its power."""
        with self._turn:
            self._line.pull()
        self._wake()

    def close(self) -> None:
        self._closing = True
        self._wake()
        self._thread.join()
        self.pull()

    def _wake(self) -> None:
        with contextlib.suppress(BlockingIOError):
            os.write(self._wake_write, b"\0")

    def _run(self) -> None:
        while not self._closing:
            timeout_s = self._step()
            # The terminal is polled: a pull may close its descriptor during a blocking read.
            with self._turn:
                ours = self._line.ours
            readers = [self._wake_read, *([] if ours is None else [ours])]
            with contextlib.suppress(OSError):
                select.select(readers, [], [], timeout_s)
            with contextlib.suppress(BlockingIOError):
                os.read(self._wake_read, _CHUNK)

    def _step(self) -> float:
        """Transfers all available bytes; returns the time until the next step, s."""
        with self._turn:
            now_s = time.monotonic()
            data = self._line.received()
            if data:
                self._firmware.receive(data, now_s)
            answer = self._firmware.transmit(now_s)
            if answer:
                self._line.send(answer)
            due_s = self._firmware.next_due_s()
        return min(max(0.0, due_s - time.monotonic()), _LONGEST_WAIT_S)
