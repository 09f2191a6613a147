"""Node battery_adapter: a battery by its vendor's own ROS driver as /battery_state."""

from __future__ import annotations

from sensor_msgs.msg import BatteryState

from robot_stack.contract import topics
from robot_stack.drivers.nodes.battery_message import battery_state, reported_flow, reported_health
from robot_stack.drivers.nodes.vendor_input import VendorInput
from robot_stack.drivers.vendor.battery import BatteryAdapterParams, complaint, reading
from robot_stack.middleware.conversions import time_from_s
from robot_stack.middleware.node import StackNode

_WATCH_HZ = 2.0


class BatteryAdapterNode(StackNode):
    def __init__(self) -> None:
        super().__init__("battery_adapter", BatteryAdapterParams)
        self._complaint = ""
        self._state = self.advertise(topics.BATTERY_STATE)
        rate_hz = topics.BATTERY_STATE.nominal_rate_hz
        self._input = VendorInput(self, topics.VENDOR_BATTERY_STATE, self.params, rate_hz, self._publish)
        self.set_health(False, f"waiting for {self.params.topic}")
        self.every(_WATCH_HZ, self._watch)

    def _publish(self, message: BatteryState, stamp_s: float) -> None:
        made = reading(
            self.params,
            present=message.present,
            voltage_v=message.voltage,
            current=message.current,
            percentage=message.percentage,
            capacity_ah=message.capacity,
            temperature_c=message.temperature,
            reported=reported_flow(message),
            health=reported_health(message),
            time_s=stamp_s,
        )
        self._complaint = complaint(made)
        self._state.publish(battery_state(made, self.params.pack.capacity_ah, time_from_s(stamp_s)))

    def _watch(self) -> None:
        """Reports silence, refusals and the battery's alarms; old readings are never repeated."""
        problem = self._input.problem() or self._complaint
        self.set_health(not problem, problem or "readings arrive")
        self.report.values |= self._input.values()
