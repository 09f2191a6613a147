"""Status records of the engine and of its devices, by the vendor's names."""

from __future__ import annotations

from dataclasses import dataclass, field

from robot_stack.wmx.api.enums import DeviceType, EngineState


@dataclass(slots=True)
class EngineStatus:
    """``error`` is the code of the last unrequested end of communication, 0 for none."""

    state: int = EngineState.Unknown
    error: int = 0
    numOfInterrupts: int = 0


@dataclass(slots=True)
class DeviceInfo:
    id: int = 0
    type: int = DeviceType.DeviceTypeNormal
    watchdog: int = 0
    watchdogCount: int = 0
    name: str = ""


@dataclass(slots=True)
class DevicesInfo:
    count: int = 0
    devices: list[DeviceInfo] = field(default_factory=list)
