"""Devices: the clients of the engine, their watchdogs, and who owns which axis."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from robot_stack.wmx.api.enums import DeviceType
from robot_stack.wmx.api.values import MAX_DEVICES


@dataclass(slots=True)
class Device:
    """One client. ``seen_cycle`` is the engine cycle of its last call."""

    id: int
    type: int = DeviceType.DeviceTypeNormal
    name: str = ""
    watchdog_ms: int = 0
    watchdog_count: int = 0
    seen_cycle: int = 0
    expired: bool = False


class DeviceTable:
    """All open devices. Ids start at 1; 0 owns what nobody owns."""

    def __init__(self) -> None:
        self._devices: dict[int, Device] = {}
        self._last_id = 0
        self._watched = False

    def __len__(self) -> int:
        return len(self._devices)

    def __iter__(self) -> Iterator[Device]:
        return iter(self._devices.values())

    def create(self, device_type: int, cycle: int) -> Device | None:
        """A new device with an id never used before, or None if there are as many as there may be."""
        if len(self._devices) >= MAX_DEVICES:
            return None
        self._last_id += 1
        device = Device(self._last_id, device_type, seen_cycle=cycle)
        self._devices[device.id] = device
        return device

    def get(self, device_id: int) -> Device | None:
        return self._devices.get(device_id)

    def remove(self, device_id: int) -> bool:
        """Forgets a device. False if there was none."""
        return self._devices.pop(device_id, None) is not None

    def clear(self) -> None:
        self._devices.clear()

    def touch(self, device_id: int, cycle: int) -> None:
        """A call of this device: its watchdog starts anew."""
        device = self._devices.get(device_id)
        if device is not None:
            device.seen_cycle = cycle
            device.expired = False

    def set_watchdog(self, device: Device, milliseconds: int) -> None:
        device.watchdog_ms = milliseconds
        self._watched = any(item.watchdog_ms for item in self)

    def hung(self, cycle: int, cycle_time_s: float) -> list[Device]:
        """Devices whose watchdog has just run out; each is named once until its next call."""
        if not self._watched:
            return []
        found = []
        for device in self:
            silent_ms = 1e3 * (cycle - device.seen_cycle) * cycle_time_s
            if device.watchdog_ms and not device.expired and silent_ms > device.watchdog_ms:
                device.expired = True
                device.watchdog_count += 1
                found.append(device)
        return found
