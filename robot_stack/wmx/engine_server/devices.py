"""Devices: the clients of the engine and their watchdogs, as the vendor has them (page_WMXDOC_FUNC_WATCHDOG_BASIC).

A library thread in the client's process reports for each device every ``REPORT_S``. Only a process that is dead or
stopped lets a watchdog run out; then the engine closes the device. It stops no axis by that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

from robot_stack.wmx.api.enums import DeviceType
from robot_stack.wmx.api.values import MAX_DEVICES

REPORT_S: Final = 0.1
DEFAULT_WATCHDOG_MS: Final = 15_000
TURNS: Final = 10
"""Number of turns over which the devices are checked: checking all processes at once would delay a cycle."""


@dataclass(slots=True)
class Device:
    """One client. ``reported_cycle``: the engine cycle of the last report that its process lives."""

    id: int
    type: int = DeviceType.DeviceTypeNormal
    name: str = ""
    watchdog_ms: int = DEFAULT_WATCHDOG_MS
    reported_cycle: int = 0

    def silent_ms(self, cycle: int, cycle_time_s: float) -> int:
        """Time since the last report, in engine time; the vendor's watchdog count."""
        return round(1e3 * (cycle - self.reported_cycle) * cycle_time_s)


class DeviceTable:
    """All open devices. Ids start at 1; 0 means no owner."""

    def __init__(self) -> None:
        self._devices: dict[int, Device] = {}
        self._last_id = 0

    def __len__(self) -> int:
        return len(self._devices)

    def __iter__(self) -> Iterator[Device]:
        return iter(self._devices.values())

    def create(self, device_type: int, cycle: int) -> Device | None:
        """A new device with an id never used before, or None if there are as many as there may be."""
        if len(self._devices) >= MAX_DEVICES:
            return None
        self._last_id += 1
        device = Device(self._last_id, device_type, reported_cycle=cycle)
        self._devices[device.id] = device
        return device

    def get(self, device_id: int) -> Device | None:
        return self._devices.get(device_id)

    def remove(self, device_id: int) -> bool:
        """Drops a device. False if there was none."""
        return self._devices.pop(device_id, None) is not None

    def clear(self) -> None:
        self._devices.clear()

    def report(self, alive: Callable[[int], bool], turn: int, cycle: int) -> None:
        """Updates the report times of this turn's devices. alive: whether the process of a device runs."""
        for device in self:
            if device.id % TURNS == turn % TURNS and alive(device.id):
                device.reported_cycle = cycle

    def expired(self, cycle: int, cycle_time_s: float) -> list[int]:
        """The devices whose watchdog has run out."""
        return [device.id for device in self if 0 < device.watchdog_ms < device.silent_ms(cycle, cycle_time_s)]
