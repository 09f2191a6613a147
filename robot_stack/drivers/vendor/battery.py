"""Checks the state of a battery of another vendor's driver (sensor_msgs/msg/BatteryState: NaN where not measured)."""

from __future__ import annotations

import math
from enum import StrEnum

from robot_stack.drivers.battery import Flow, Health, PackLimits, Reading, flow, implausible
from robot_stack.drivers.vendor.topic import MessageRefused, VendorTopicParams


class ChargeIn(StrEnum):
    """Unit of the driver's ``percentage``: the message says 0 to 1, some drivers publish 0 to 100."""

    FRACTION = "fraction"
    PERCENT = "percent"


class BatteryAdapterParams(VendorTopicParams):
    """inverted_current: the driver's current is positive while discharging; the message says negative."""

    charge_in: ChargeIn
    inverted_current: bool
    pack: PackLimits


def reading(
    params: BatteryAdapterParams,
    *,
    present: bool,
    voltage_v: float,
    current: float,
    percentage: float,
    capacity_ah: float,
    temperature_c: float,
    reported: Flow | None,
    health: Health,
    time_s: float,
) -> Reading:
    """The fields of a message, current and percentage as the driver counts them. reported: None if it is unknown.

    Raises MessageRefused.
    """
    if not present:
        raise MessageRefused("present is false, expected a battery")
    if not math.isfinite(percentage):
        raise MessageRefused(
            f"percentage is {percentage}: the driver must measure the charge; it is not estimated from the voltage"
        )
    whole = 100.0 if params.charge_in is ChargeIn.PERCENT else 1.0
    if not 0.0 <= percentage <= whole:
        raise MessageRefused(f"percentage is {percentage:g}, expected 0 to {whole:g}: see charge_in")
    if not math.isfinite(current):
        raise MessageRefused(f"current is {current}, expected a measurement")
    current_a = -current if params.inverted_current else current
    temperature = None if math.isnan(temperature_c) else temperature_c
    why = implausible(voltage_v, current_a, temperature, params.pack)
    if why:
        raise MessageRefused(why)
    flows = flow(current_a, percentage / whole, params.pack.idle_current_a)
    if reported is not None and {flows, reported} == {Flow.CHARGING, Flow.DISCHARGING}:
        raise MessageRefused(
            f"the status is {reported.value}, but {current_a:g} A mean {flows.value}: see inverted_current"
        )
    capacity = capacity_ah if math.isfinite(capacity_ah) and capacity_ah > 0.0 else params.pack.capacity_ah
    return Reading(time_s, voltage_v, current_a, percentage / whole, capacity, temperature_c, flows, health)


def complaint(state: Reading) -> str:
    """The battery's own alarm; empty without one."""
    return "" if state.health in (Health.GOOD, Health.UNKNOWN) else f"the battery reports: {state.health.value}"
