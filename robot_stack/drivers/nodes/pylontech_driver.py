"""Node pylontech_driver: a battery of Pylontech's CAN protocol as /battery_state."""

from __future__ import annotations

from functools import partial

from robot_stack.contract import topics
from robot_stack.core.runtime import runtime_dir
from robot_stack.drivers.nodes.battery_message import battery_state
from robot_stack.drivers.nodes.can_bus import CanBus
from robot_stack.drivers.pylontech.frames import KEEP_ALIVE, Measured
from robot_stack.drivers.pylontech.pack import Pack
from robot_stack.drivers.pylontech.params import PylontechDriverParams
from robot_stack.middleware.device_thread import DeviceThread
from robot_stack.middleware.node import StackNode

_WATCH_HZ = 2.0


class PylontechDriverNode(StackNode):
    """Publishes each received measurement once; old values are never repeated."""

    def __init__(self) -> None:
        super().__init__("pylontech_driver", PylontechDriverParams)
        self._pack = Pack(self.params.pack)
        self._state = self.advertise(topics.BATTERY_STATE)
        can = self.params.can
        # An absolute path replaces the runtime folder; a network interface has none.
        channel = str(runtime_dir() / can.channel) if can.interface == "slcan" else can.channel
        self.set_health(False, f"waiting for the battery on {channel}")
        self._bus = CanBus(self.device_s, channel, can, (KEEP_ALIVE, bytes(8)), self._on_frame)
        self._thread = DeviceThread(self._bus, can.reopen_s)
        self.at_end.callback(self._thread.close)
        self.every(_WATCH_HZ, self._watch)

    def _on_frame(self, number: int, data: bytes) -> None:
        self.call_soon(partial(self._take, number, data))

    def _take(self, number: int, data: bytes) -> None:
        now_s = self.steady_s()
        if isinstance(self._pack.received(number, data, now_s), Measured):
            reading = self._pack.reading(now_s)
            if reading is not None:
                self._state.publish(battery_state(reading, self.params.pack.capacity_ah, self.stamp()))

    def _watch(self) -> None:
        now_s = self.steady_s()
        problem, reading = self._pack.problem(now_s), self._pack.reading(now_s)
        if reading is None:
            problem = f"{problem}; {self._thread.state}"
        self.set_health(not problem, problem or "readings arrive")
        self.report.values |= {
            "device": f"battery on {self._thread.state}",
            "opened": f"{self._thread.opened} times",
            "frames corrupt": str(self._bus.corrupt),
            **self._pack.values(now_s),
        }
