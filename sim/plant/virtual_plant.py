"""Axes without a machine: virtual drives that follow their commands, with faults to inject on a test bench."""

from __future__ import annotations

from collections.abc import Mapping

from robot_stack.wmx.config import EngineConfig
from robot_stack.wmx.engine_server.virtual_drives import VirtualDrives
from sim.plant.fault_table import FaultKind

DEFAULT_ALARM_CODE = 0x4210  # CiA 402: excess temperature of the device


class VirtualPlant:
    """A Plant: the drives of ``config``'s axes, each on a shaft of its own without load."""

    def __init__(self, config: EngineConfig) -> None:
        self.bus = VirtualDrives(config.n_axes, config.cycle_time_s)
        self.time_s = 0.0
        self.names = tuple(axis.name for axis in config.axes)
        self.fault_kinds: Mapping[str, FaultKind] = {kind.name: kind for kind in self._kinds()}
        self._cycle_s = config.cycle_time_s

    def step(self) -> None:
        """Only advances the time: the drives move when the bus is served."""
        self.time_s += self._cycle_s

    def _kinds(self) -> tuple[FaultKind, ...]:
        def row(name: str, what: str, change: object, targets: tuple[str, ...] = ("",)) -> FaultKind:
            return FaultKind(name, what, targets, "none", change)  # type: ignore[arg-type]

        alarm = "a fault inside a drive; its alarm stays until the engine clears it"
        return (
            FaultKind(
                "drive_alarm", alarm, self.names, "alarm code", _drive_alarm, 1.0, 65535.0, float(DEFAULT_ALARM_CODE)
            ),
            row("bus_loss", "no telegram passes between engine and drives", _bus_loss),
            row("encoder_freeze", "an encoder repeats its last count", _encoder_freeze, self.names),
            row("drive_broken", "a drive cannot be switched on, and drops out if it is", _broken, self.names),
        )


def _drive_alarm(plant: VirtualPlant, target: str, value: float | None) -> str:
    if value is not None:  # ended, the alarm waits to be cleared
        plant.bus.alarms[plant.names.index(target)] = int(value)
    return f"drive of {target} reports alarm 0x{int(value or 0):04X}"


def _bus_loss(plant: VirtualPlant, target: str, value: float | None) -> str:
    plant.bus.connected = value is None
    return "the fieldbus is cut"


def _encoder_freeze(plant: VirtualPlant, target: str, value: float | None) -> str:
    plant.bus.frozen[plant.names.index(target)] = value is not None
    return f"encoder of {target} repeats its last count"


def _broken(plant: VirtualPlant, target: str, value: float | None) -> str:
    plant.bus.broken[plant.names.index(target)] = value is not None
    return f"drive of {target} cannot be on"
