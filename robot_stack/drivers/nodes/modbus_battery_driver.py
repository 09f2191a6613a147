"""Node modbus_battery_driver: a battery monitor on Modbus as /battery_state."""

from __future__ import annotations

from functools import partial

from robot_stack.contract import topics
from robot_stack.core.runtime import runtime_dir
from robot_stack.drivers.modbus.battery import ModbusBattery
from robot_stack.drivers.modbus.params import ModbusBatteryDriverParams
from robot_stack.drivers.nodes.battery_message import battery_state
from robot_stack.drivers.nodes.modbus_unit import ModbusUnit
from robot_stack.middleware.device_thread import DeviceThread
from robot_stack.middleware.node import StackNode

_WATCH_HZ = 2.0


class ModbusBatteryDriverNode(StackNode):
    """Publishes each received measurement once; old values are never repeated."""

    def __init__(self) -> None:
        super().__init__("modbus_battery_driver", ModbusBatteryDriverParams)
        params = self.params
        self._battery = ModbusBattery(params.registers, params.alarms, params.pack)
        self._state = self.advertise(topics.BATTERY_STATE)
        serial_port = str(runtime_dir() / params.modbus.serial_port)  # an absolute path replaces the folder
        unit = ModbusUnit(params.modbus, serial_port, self._battery.blocks(), self._on_registers)
        self.set_health(False, f"waiting for the battery on {unit.where}")
        self._thread = DeviceThread(unit, params.modbus.reopen_s)
        self.at_end.callback(self._thread.close)
        self.every(_WATCH_HZ, self._watch)

    def _on_registers(self, raw: dict[int, int]) -> None:
        self.call_soon(partial(self._take, raw))

    def _take(self, raw: dict[int, int]) -> None:
        reading = self._battery.received(raw, self.steady_s())
        if reading is not None:
            self._state.publish(battery_state(reading, self.params.pack.capacity_ah, self.stamp()))

    def _watch(self) -> None:
        now_s = self.steady_s()
        problem = self._battery.problem(now_s)
        if self._battery.reading(now_s) is None:
            problem = f"{problem}; {self._thread.state}"
        self.set_health(not problem, problem or "readings arrive")
        self.report.values |= {
            "device": f"battery on {self._thread.state}",
            "opened": f"{self._thread.opened} times",
            **self._battery.values(now_s),
        }
