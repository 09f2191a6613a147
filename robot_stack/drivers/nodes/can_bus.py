"""A CAN interface: receives the frames of a device and keeps the device awake."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import can

from robot_stack.drivers.pylontech.params import CanParams
from robot_stack.middleware.device_thread import DeviceLost, DeviceThread

_POLL_S = 0.2
_SLCAN_READ_S = 0.1  # python-can's own 1 ms would wake a core a thousand times a second


class CanBus:
    """``on_frame`` is called from the device's thread with identifier and data.

    clock: the node's ``device_s``, for its silence.
    channel: network interface or device path. keep_alive: (identifier, data) that is sent every ``keep_alive_s``.
    """

    def __init__(
        self,
        clock: Callable[[], float],
        channel: str,
        params: CanParams,
        keep_alive: tuple[int, bytes],
        on_frame: Callable[[int, bytes], None],
    ) -> None:
        self._clock = clock
        self.where, self._params, self._on_frame = channel, params, on_frame
        identifier, data = keep_alive
        self._keep_alive = can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
        self.corrupt = 0

    def use(self, thread: DeviceThread) -> None:
        options: dict[str, Any] = {"timeout": _SLCAN_READ_S} if self._params.interface == "slcan" else {}
        interface, rate = self._params.interface, self._params.bitrate
        with can.Bus(interface=interface, channel=self.where, bitrate=rate, **options) as bus:
            thread.report_open()
            self._read(bus, thread)

    def _read(self, bus: can.BusABC, thread: DeviceThread) -> None:
        received_s = sent_s = self._clock()
        while thread.running:
            message = self._next(bus)
            now_s = self._clock()
            if message is not None and not (
                message.is_extended_id or message.is_remote_frame or message.is_error_frame
            ):
                received_s = now_s
                self._on_frame(message.arbitration_id, bytes(message.data))
            if self._params.keep_alive_s is not None and now_s - sent_s >= self._params.keep_alive_s:
                sent_s = now_s
                bus.send(self._keep_alive, timeout=_POLL_S)
            if now_s - received_s >= self._params.silent_s:
                raise DeviceLost("is open, but no data arrives")

    def _next(self, bus: can.BusABC) -> can.Message | None:
        try:
            return bus.recv(timeout=_POLL_S)
        except (ValueError, IndexError):  # corrupted by an adapter on a serial line
            self.corrupt += 1
            bus.flush() if hasattr(bus, "flush") else None
            return None
