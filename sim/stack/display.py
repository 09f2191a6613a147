"""The external display on the scheduler: the bridge's link and the display's firmware, with bytes between them.

Counterparts of ``robot_stack.ehmi.nodes.serial_port.SerialPort`` and ``sim.ehmi.line.DisplayLine``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from robot_stack.ehmi.link import Link, LinkStatus, Shown
from robot_stack.ehmi.params import LinkParams
from robot_stack.middleware.port import Port
from sim.ehmi.firmware import Display, Firmware
from sim.ehmi.params import FirmwareParams

ResultT = TypeVar("ResultT")
_BYTE_S = 10.0 / 115200.0  # 8N1
_LEAST_S = 0.001


class Cable:
    """Carries bytes both ways while it is connected at the display and open at the bridge.

    at: calls a function after a delay in virtual seconds.
    """

    def __init__(self, after: Callable[[float, Callable[[], None]], None]) -> None:
        self._after = after
        self.display: ScheduledDisplay | None = None
        self.bridge: ScheduledSerialPort | None = None
        self.plugged = False

    def to_display(self, data: bytes) -> None:
        self._after(len(data) * _BYTE_S, lambda: self._deliver(data))

    def to_bridge(self, data: bytes) -> None:
        """Delivers at once: the firmware accounts for the time of its bytes."""
        if self.plugged and self.bridge is not None:
            self.bridge.receive(data)

    def _deliver(self, data: bytes) -> None:
        if self.plugged and self.display is not None:
            self.display.receive(data)


class _Alarm:
    """A re-armed one-shot timer of a node."""

    def __init__(self, port: Port, callback: Callable[[], None]) -> None:
        self._port, self._callback = port, callback
        self._timer: Any = None

    def set(self, after_s: float) -> None:
        self.cancel()
        if after_s < math.inf:
            timer = self._timer = self._port.add_real_timer(max(_LEAST_S, after_s), self._ring)
            timer.reset()  # from now, not from the schedule's next whole period

    def cancel(self) -> None:
        if self._timer is not None:
            self._timer.destroy()
            self._timer = None

    def _ring(self) -> None:
        self.cancel()
        self._callback()


class ScheduledSerialPort:
    """See ``SerialPort``."""

    def __init__(self, port: Port, cable: Cable, params: LinkParams, wanted: Shown) -> None:
        self._port, self._cable = port, cable
        self._link = Link(params, wanted)
        self._alarm = _Alarm(port, self._act)
        self._open = False
        cable.bridge = self
        self._act()

    def show(self, wanted: Shown) -> None:
        """Raises ValueError for a state that the display does not have."""
        self._link.show(wanted, self._port.monotonic_s())
        self._act()

    def status(self) -> LinkStatus:
        return self._link.status

    def rejected(self) -> dict[str, int]:
        return self._link.rejected

    def close(self) -> None:
        self._alarm.cancel()
        if self._cable.bridge is self:
            self._cable.bridge = None

    def receive(self, data: bytes) -> None:
        if self._open:
            self._port.call_soon(lambda: self._on_data(data))

    def hang_up(self) -> None:
        """The cable was pulled."""
        if self._open:
            self._port.call_soon(self._on_hang_up)

    def _on_data(self, data: bytes) -> None:
        self._link.received(data, self._port.monotonic_s())
        self._act()

    def _on_hang_up(self) -> None:
        self._open = False
        self._link.lost("the cable is gone", self._port.monotonic_s())
        self._act()

    def _act(self) -> None:
        now_s = self._port.monotonic_s()
        order = self._link.step(now_s)
        if order.close:
            self._open = False
        if order.open:
            self._open = self._cable.plugged
            if self._open:
                self._link.opened(now_s)
            else:
                self._link.lost("no display is on the line", now_s)
            order = self._link.step(now_s)
        if order.data and self._open:
            self._cable.to_display(order.data)
        self._alarm.set(self._link.next_due_s() - now_s)


class ScheduledDisplay:
    """See ``DisplayLine``."""

    def __init__(self, port: Port, cable: Cable, params: FirmwareParams, link: Path) -> None:
        self._port, self._cable = port, cable
        self._firmware = Firmware(params)
        self._alarm = _Alarm(port, self._transmit)
        cable.display = self
        self._firmware.power_on(self.time_s)
        self.plug()
        self._transmit()

    @property
    def time_s(self) -> float:
        return self._port.monotonic_s()

    def with_firmware(self, act: Callable[[Firmware, float], ResultT]) -> ResultT:
        result = act(self._firmware, self.time_s)
        self._transmit()
        return result

    def display(self) -> Display:
        return self._firmware.display(self.time_s)

    def plug(self) -> None:
        self._cable.plugged = True

    def pull(self) -> None:
        self._cable.plugged = False
        if self._cable.bridge is not None:
            self._cable.bridge.hang_up()

    def receive(self, data: bytes) -> None:
        self._port.call_soon(lambda: self._on_data(data))

    def close(self) -> None:
        self._alarm.cancel()
        self.pull()

    def _on_data(self, data: bytes) -> None:
        self._firmware.receive(data, self.time_s)
        self._transmit()

    def _transmit(self) -> None:
        data = self._firmware.transmit(self.time_s)
        if data:
            self._cable.to_bridge(data)
        self._alarm.set(self._firmware.next_due_s() - self.time_s)
