"""The battery: open-circuit voltage over charge, internal resistance, and the drives' power, also regenerated."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.contract.frames import DRIVE_AXES, STEER_AXES
from sim.params import Battery

_SECONDS_PER_HOUR = 3600.0


@dataclass(frozen=True, slots=True)
class BatteryReading:
    """At the terminals: V, A (negative while discharging, as in sensor_msgs), charge 0-1, Ah left, degrees Celsius.

    charging: more flows in than out.
    """

    voltage_v: float
    current_a: float
    charge: float
    charge_ah: float
    temperature_c: float
    charging: bool


class BatteryModel:
    """Integrates charge. ``draw`` is called with the motors' state at any rate."""

    def __init__(self, params: Battery, random: np.random.Generator) -> None:
        self._params = params
        self._random = random
        self._loss_w_per_nm2 = np.zeros(len(DRIVE_AXES) + len(STEER_AXES))
        self._loss_w_per_nm2[list(DRIVE_AXES)] = params.copper_loss_w_per_nm2.drive
        self._loss_w_per_nm2[list(STEER_AXES)] = params.copper_loss_w_per_nm2.steer
        self.charge = params.initial_charge
        self._current_a = 0.0
        self.charger_w = 0.0  # power of a charger that is plugged in; 0: none
        self.contacts_w = 0.0  # power by the charging contacts; 0: they touch nothing

    def draw(self, torques_nm: NDArray[np.float64], speeds_radps: NDArray[np.float64], duration_s: float) -> None:
        """``duration_s`` at the given motor torques and speeds, both (8,)."""
        self._current_a = self._current(self.power_w(torques_nm, speeds_radps) - self.supply_w)
        left = self.charge - self._current_a * duration_s / (self._params.capacity_ah * _SECONDS_PER_HOUR)
        self.charge = min(1.0, max(0.0, left))

    @property
    def supply_w(self) -> float:
        """Power into the pack, W, before the robot's own consumption. A full pack takes none."""
        return self.charger_w + self.contacts_w

    def power_w(self, torques_nm: NDArray[np.float64], speeds_radps: NDArray[np.float64]) -> float:
        """Electrical power out of the pack, W; braking drives regenerate."""
        mechanical = torques_nm * speeds_radps
        efficiency = self._params.drive_efficiency
        # The larger value: electrical input exceeds mechanical output, and regenerated power is below mechanical input.
        drives = np.maximum(mechanical / efficiency, mechanical * efficiency)
        return float(np.sum(drives + self._loss_w_per_nm2 * torques_nm**2)) + self._params.idle_power_w

    def open_circuit_v(self) -> float:
        """Voltage without load."""
        params = self._params
        return params.cells_in_series * float(np.interp(self.charge, params.charge, params.cell_voltage_v))

    def read(self) -> BatteryReading:
        """The battery management's reading, with the noise of its voltmeter."""
        params = self._params
        voltage = self.open_circuit_v() - params.internal_resistance_ohm * self._current_a
        noise = params.voltage_noise_v * float(self._random.standard_normal())
        return BatteryReading(
            voltage_v=voltage + noise,
            current_a=-self._current_a,
            charge=self.charge,
            charge_ah=self.charge * params.capacity_ah,
            temperature_c=params.temperature_c,
            charging=self.supply_w > 0.0 and self._current_a < 0.0,
        )

    def _current(self, power_w: float) -> float:
        """P = (U0 - R I) I, the smaller root; beyond the pack's greatest power, the current of that."""
        u0, r = self.open_circuit_v(), self._params.internal_resistance_ohm
        return (u0 - math.sqrt(max(0.0, u0 * u0 - 4.0 * r * power_w))) / (2.0 * r)
