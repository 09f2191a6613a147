"""The battery's state from its registers, while they are fresh."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from robot_stack.drivers.battery import Health, PackParams, Reading, flow, implausible
from robot_stack.drivers.counters import Counters
from robot_stack.drivers.modbus.params import AlarmsParams, RegisterParams, RegistersParams

TAKEN, REFUSED = "answers", "answers refused"
_SIGN_BIT, _REGISTER_RANGE = 0x8000, 0x10000
_FULL_PERCENT = 100.0
# The worst first.
_ALARMS = {
    "failure": Health.FAILURE,
    "too_hot": Health.HOT,
    "over_voltage": Health.OVER_VOLTAGE,
    "under_voltage": Health.EMPTY,
    "too_cold": Health.COLD,
}


class Block(NamedTuple):
    """Consecutive registers that are requested together."""

    first: int
    size: int

    def singles(self) -> list[Block]:
        return [Block(address, 1) for address in range(self.first, self.first + self.size)]


def blocks(addresses: Iterable[int]) -> tuple[Block, ...]:
    """No block spans an unused register: a device rejects a block with a register that it lacks."""
    found: list[Block] = []
    for address in sorted(set(addresses)):
        if found and address == found[-1].first + found[-1].size:
            found[-1] = Block(found[-1].first, found[-1].size + 1)
        else:
            found.append(Block(address, 1))
    return tuple(found)


class ModbusBattery:
    """Call for every response. Times are plain steady seconds."""

    def __init__(self, registers: RegistersParams, alarms: AlarmsParams, pack: PackParams) -> None:
        self._registers, self._pack = registers, pack
        self._alarms: dict[str, tuple[int, ...]] = alarms.model_dump()
        self._reading: Reading | None = None
        self._complaints: tuple[str, ...] = ()
        self._missing: tuple[int, ...] = ()
        self.refusal = ""
        self.counters = Counters(TAKEN, REFUSED)

    def blocks(self) -> tuple[Block, ...]:
        """The blocks to request."""
        rows = (getattr(self._registers, name) for name in RegistersParams.model_fields)
        alarms = (address for addresses in self._alarms.values() for address in addresses)
        return blocks([*(row.address for row in rows if row is not None), *alarms])

    def received(self, raw: Mapping[int, int], now_s: float) -> Reading | None:
        """raw: the received registers, by address; missing ones are not in the device. None if
        they are implausible: the reading before becomes stale.
        """
        self._missing = tuple(
            address for first, count in self.blocks() for address in range(first, first + count) if address not in raw
        )
        self.refusal = self._take(raw, now_s)
        self.counters.add(REFUSED if self.refusal else TAKEN)
        return None if self.refusal else self._reading

    def _take(self, raw: Mapping[int, int], now_s: float) -> str:
        """Why there is no reading in it; empty if there is one."""
        registers, limits = self._registers, self._pack
        needed = (registers.voltage, registers.current, registers.charge)
        lacking = [str(row.address) for row in needed if row.address not in raw]
        if lacking:
            return f"the device refuses register {' and '.join(lacking)}"
        voltage_v, current_a, percent = (_value(raw, row) for row in needed)
        temperature_c = _optional(raw, registers.temperature)
        why = implausible(voltage_v, current_a, temperature_c, limits)
        if not why and not 0.0 <= percent <= _FULL_PERCENT:
            why = f"the charge is {percent:g} %, expected 0 to 100 %"
        healthy = _optional(raw, registers.state_of_health)
        if not why and healthy is not None and not 0.0 < healthy <= _FULL_PERCENT:
            why = f"the state of health is {healthy:g} %, expected above 0 and at most 100 %"
        if why:
            return why
        self._complaints = tuple(
            name for name, addresses in self._alarms.items() if any(raw.get(address, 0) for address in addresses)
        )
        self._reading = Reading(
            now_s,
            voltage_v,
            current_a,
            percent / _FULL_PERCENT,
            limits.capacity_ah * (_FULL_PERCENT if healthy is None else healthy) / _FULL_PERCENT,
            math.nan if temperature_c is None else temperature_c,
            flow(current_a, percent / _FULL_PERCENT, limits.idle_current_a),
            self._health(raw),
        )
        return ""

    def _health(self, raw: Mapping[int, int]) -> Health:
        if not any(address in raw for addresses in self._alarms.values() for address in addresses):
            return Health.UNKNOWN
        return next((health for name, health in _ALARMS.items() if name in self._complaints), Health.GOOD)

    def reading(self, now_s: float) -> Reading | None:
        """The newest reading; None if it is stale: see ``problem``."""
        if self._reading is None or not 0.0 <= now_s - self._reading.time_s <= self._pack.stale_s:
            return None
        return self._reading

    def problem(self, now_s: float) -> str:
        """Why there is no reading, or the battery's alarms; empty without a problem."""
        if self.reading(now_s) is None:
            why = f", the last was refused: {self.refusal}" if self.refusal else ""
            return f"no valid response for {self._pack.stale_s:g} s{why}"
        complaints = ", ".join(name.replace("_", " ") for name in self._complaints)
        return f"the battery reports faults: {complaints}" if complaints else ""

    def values(self, now_s: float) -> dict[str, str]:
        """For /diagnostics."""
        known = self.reading(now_s) is not None
        return {
            "alarms": (", ".join(self._complaints) or "none") if known else "not received",
            "registers it lacks": ", ".join(map(str, self._missing)) or "none",
            **self.counters.values(),
        }


def _value(raw: Mapping[int, int], register: RegisterParams) -> float:
    value = raw[register.address]
    if register.signed and value & _SIGN_BIT:
        value -= _REGISTER_RANGE
    return value / register.per_unit


def _optional(raw: Mapping[int, int], register: RegisterParams | None) -> float | None:
    return None if register is None or register.address not in raw else _value(raw, register)
