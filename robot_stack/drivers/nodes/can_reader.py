"""The thread that owns a CAN interface: it opens, reads, keeps the device awake, and reopens it if lost."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Any

import can

from robot_stack.drivers.pylontech.params import CanParams

_POLL_S = 0.2
_SLCAN_READ_S = 0.1  # python-can's own 1 ms would wake a core a thousand times a second


class CanReader:
    """Starts at once; ``close`` ends it. ``on_frame`` is called from its thread with identifier and data.

    channel: network interface or device path. keep_alive: (identifier, data) that is sent every ``keep_alive_s``.
    """

    def __init__(
        self, channel: str, params: CanParams, keep_alive: tuple[int, bytes], on_frame: Callable[[int, bytes], None]
    ) -> None:
        self._channel, self._params, self._on_frame = channel, params, on_frame
        identifier, data = keep_alive
        self._keep_alive = can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
        self.state = f"{channel} is not open yet"
        self.opened, self.corrupt = 0, 0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="can_reader", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Safe to call twice."""
        self._closing.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._closing.is_set():
            bus = None
            try:
                bus = self._open()
                self._read(bus)
            except (can.CanError, OSError, ValueError) as error:
                self.state = f"{self._channel}: {error}"
            finally:
                if bus is not None:
                    with contextlib.suppress(can.CanError, OSError):  # its line may be gone
                        bus.shutdown()
            self._closing.wait(self._params.reopen_s)

    def _open(self) -> can.BusABC:
        options: dict[str, Any] = {"timeout": _SLCAN_READ_S} if self._params.interface == "slcan" else {}
        return can.Bus(interface=self._params.interface, channel=self._channel, bitrate=self._params.bitrate, **options)

    def _read(self, bus: can.BusABC) -> None:
        """Reads until the interface is lost (an exception), silent for too long, or closed by us."""
        self.opened += 1
        self.state = f"{self._channel} is open"
        heard_s = told_s = time.monotonic()
        while not self._closing.is_set():
            message = self._next(bus)
            now_s = time.monotonic()
            if message is not None and not (
                message.is_extended_id or message.is_remote_frame or message.is_error_frame
            ):
                heard_s = now_s
                self._on_frame(message.arbitration_id, bytes(message.data))
            if self._params.keep_alive_s is not None and now_s - told_s >= self._params.keep_alive_s:
                told_s = now_s
                bus.send(self._keep_alive, timeout=_POLL_S)
            if now_s - heard_s >= self._params.silent_s:
                self.state = f"{self._channel} is open, but no data arrives"
                return

    def _next(self, bus: can.BusABC) -> can.Message | None:
        try:
            return bus.recv(timeout=_POLL_S)
        except (ValueError, IndexError):  # corrupted by an adapter on a serial line
            self.corrupt += 1
            bus.flush() if hasattr(bus, "flush") else None
            return None
