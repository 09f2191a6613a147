"""Shared parts of the battery drivers: a reading, and its plausible range."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config


class Flow(Enum):
    CHARGING = "charging"
    DISCHARGING = "discharging"
    IDLE = "idle"
    FULL = "full"


class Health(Enum):
    UNKNOWN = "unknown"
    GOOD = "good"
    HOT = "too hot"
    COLD = "too cold"
    OVER_VOLTAGE = "over voltage"
    EMPTY = "under voltage"
    FAILURE = "failure"


@dataclass(frozen=True, slots=True)
class Reading:
    """V, A (negative while discharging), charge [0, 1], Ah, degrees Celsius (NaN: not measured).

    time_s: of the measurement's arrival.
    """

    time_s: float
    voltage_v: float
    current_a: float
    charge: float
    capacity_ah: float
    temperature_c: float
    flow: Flow
    health: Health


class PackLimits(Config):
    """Data of the battery and plausible ranges of its measurements. idle_current_a: smaller currents count as idle."""

    capacity_ah: Annotated[float, Field(gt=0.0, le=2000.0)]
    voltage_min_v: Annotated[float, Field(gt=0.0, le=100.0)]
    voltage_max_v: Annotated[float, Field(gt=0.0, le=100.0)]
    current_max_a: Annotated[float, Field(gt=0.0, le=2000.0)]
    temperature_min_c: Annotated[float, Field(ge=-60.0, le=0.0)]
    temperature_max_c: Annotated[float, Field(ge=30.0, le=150.0)]
    idle_current_a: Annotated[float, Field(ge=0.0, le=10.0)]

    @model_validator(mode="after")
    def _makes_sense(self) -> PackLimits:
        if self.voltage_max_v <= self.voltage_min_v:
            raise ValueError("voltage_max_v must be above voltage_min_v")
        return self


class PackParams(PackLimits):
    """stale_s: age after which data is dropped."""

    stale_s: Annotated[float, Field(ge=1.0, le=4.0)]


def implausible(voltage_v: float, current_a: float, temperature_c: float | None, limits: PackLimits) -> str:
    """Why these measurements are implausible; empty if they are plausible. temperature_c: None where there is none."""
    if not limits.voltage_min_v <= voltage_v <= limits.voltage_max_v:
        between = f"{limits.voltage_min_v} to {limits.voltage_max_v} V"
        return f"the voltage is {voltage_v} V, expected {between}"
    if abs(current_a) > limits.current_max_a:
        return f"the current is {current_a} A, expected at most {limits.current_max_a} A"
    if temperature_c is not None and not limits.temperature_min_c <= temperature_c <= limits.temperature_max_c:
        between = f"{limits.temperature_min_c} to {limits.temperature_max_c} degrees"
        return f"the temperature is {temperature_c} degrees, expected {between}"
    return ""


def flow(current_a: float, charge: float, idle_current_a: float) -> Flow:
    if current_a > idle_current_a:
        return Flow.CHARGING
    if current_a < -idle_current_a:
        return Flow.DISCHARGING
    return Flow.FULL if charge >= 1.0 else Flow.IDLE
