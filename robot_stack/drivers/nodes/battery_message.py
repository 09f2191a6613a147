"""A battery's reading as the message of ROS."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from sensor_msgs.msg import BatteryState

from robot_stack.drivers.battery import Flow, Health, Reading

_FLOW = {
    Flow.CHARGING: BatteryState.POWER_SUPPLY_STATUS_CHARGING,
    Flow.DISCHARGING: BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
    Flow.IDLE: BatteryState.POWER_SUPPLY_STATUS_NOT_CHARGING,
    Flow.FULL: BatteryState.POWER_SUPPLY_STATUS_FULL,
}
_HEALTH = {
    Health.UNKNOWN: BatteryState.POWER_SUPPLY_HEALTH_UNKNOWN,
    Health.GOOD: BatteryState.POWER_SUPPLY_HEALTH_GOOD,
    Health.HOT: BatteryState.POWER_SUPPLY_HEALTH_OVERHEAT,
    Health.COLD: BatteryState.POWER_SUPPLY_HEALTH_COLD,
    Health.OVER_VOLTAGE: BatteryState.POWER_SUPPLY_HEALTH_OVERVOLTAGE,
    Health.EMPTY: BatteryState.POWER_SUPPLY_HEALTH_DEAD,
    Health.FAILURE: BatteryState.POWER_SUPPLY_HEALTH_UNSPEC_FAILURE,
}


def battery_state(reading: Reading, design_capacity_ah: float, stamp: Time) -> BatteryState:
    message = BatteryState(
        voltage=reading.voltage_v,
        current=reading.current_a,
        charge=reading.charge * reading.capacity_ah,
        capacity=reading.capacity_ah,
        design_capacity=design_capacity_ah,
        percentage=reading.charge,
        temperature=reading.temperature_c,
        power_supply_status=_FLOW[reading.flow],
        power_supply_health=_HEALTH[reading.health],
        power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_LIFE,
        present=True,
    )
    message.header.stamp = stamp
    return message


def reported_flow(message: BatteryState) -> Flow | None:
    """The status of another driver's message; None if it is unknown."""
    return next((flow for flow, status in _FLOW.items() if status == message.power_supply_status), None)


def reported_health(message: BatteryState) -> Health:
    """The health of another driver's message. Codes without a counterpart here are failures."""
    health = message.power_supply_health
    return next((mine for mine, code in _HEALTH.items() if code == health), Health.FAILURE)
