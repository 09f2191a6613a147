"""Node battery_driver: the simulated battery as /battery_state, or on a CAN bus at an adapter on a serial line."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from sensor_msgs.msg import BatteryState

from robot_stack.contract import topics
from robot_stack.core.config import Config
from robot_stack.core.runtime import runtime_dir
from robot_stack.middleware.node import StackNode
from sim.devices.battery_line import BatteryLine
from sim.plant.battery import BatteryReading

_CHARGING = BatteryState.POWER_SUPPLY_STATUS_CHARGING
_DISCHARGING = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING


class BatteryDriverParams(Config):
    """``config/battery_driver.yaml``.

    port: a pseudo terminal in the runtime folder: an adapter of the CAN bus of a Pylontech battery; empty: no bus, but
    the topic.
    """

    port: str


class BatteryDriver(StackNode):
    def __init__(self) -> None:
        super().__init__("battery_driver", BatteryDriverParams)
        port = self.params.port
        self._line = BatteryLine(runtime_dir() / port) if port else None
        if self._line is None:
            self._state = self.advertise(topics.BATTERY_STATE)

    def publish(self, reading: BatteryReading, capacity_ah: float, stamp: Time) -> None:
        self.set_health(True, "readings arrive")
        if self._line is not None:
            self._line.send(reading)
            return
        message = BatteryState(
            voltage=reading.voltage_v,
            current=reading.current_a,
            charge=reading.charge_ah,
            capacity=capacity_ah,
            design_capacity=capacity_ah,
            percentage=reading.charge,
            temperature=reading.temperature_c,
            power_supply_status=_CHARGING if reading.charging else _DISCHARGING,
            power_supply_health=BatteryState.POWER_SUPPLY_HEALTH_GOOD,
            power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_LION,
            present=True,
        )
        message.header.stamp = stamp
        self._state.publish(message)
