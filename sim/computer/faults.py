"""Faults of the simulated robot's computer, raised by ``/sim/inject_computer_fault``."""

from __future__ import annotations

from sim.computer.computer import SimComputer
from sim.computer.disk import NoNamespaces
from sim.plant.fault_table import FaultKind, FaultRefused, FaultTable

_ONLY = ("",)


def _overheat(computer: SimComputer, target: str, value: float | None) -> str:
    computer.kernel.celsius = computer.params.celsius if value is None else value
    return f"the computer is at {computer.kernel.celsius:g} C"


def _cpu_high(computer: SimComputer, target: str, value: float | None) -> str:
    computer.kernel.cpu_percent = computer.params.cpu_percent if value is None else value
    return f"the processors are busy to {computer.kernel.cpu_percent:g} %"


def _memory_high(computer: SimComputer, target: str, value: float | None) -> str:
    computer.kernel.memory_percent = computer.params.memory_percent if value is None else value
    return f"the memory is taken to {computer.kernel.memory_percent:g} %"


def _disk_full(computer: SimComputer, target: str, value: float | None) -> str:
    if value is None:
        computer.disk.empty()
        return ""
    try:
        computer.disk.fill()
    except NoNamespaces as error:
        raise FaultRefused(f"disk_full: {error}") from None
    return "the disk is full"


def _screen_lost(computer: SimComputer, target: str, value: float | None) -> str:
    if value is None:
        computer.screen.show()
        return ""
    if computer.address() is None:
        raise FaultRefused("screen_lost: the touch screen has no server")
    computer.screen.lose()
    return "the browser on the robot's screen dies"


FAULT_KINDS: tuple[FaultKind, ...] = (
    FaultKind("overheat", "the hottest thermal zone", _ONLY, "degrees Celsius", _overheat, -40.0, 150.0, 90.0),
    FaultKind("cpu_high", "all processors together", _ONLY, "%", _cpu_high, 0.0, 100.0, 99.0),
    FaultKind("memory_high", "memory that is not available", _ONLY, "%", _memory_high, 0.0, 100.0, 97.0),
    FaultKind("disk_full", "the file system of the recordings is full", _ONLY, "none", _disk_full),
    # Without a page, one opens and closes once it has been seen. If other pages stay, the link is not lost.
    FaultKind("screen_lost", "the page on the robot's own screen is gone", _ONLY, "none", _screen_lost),
)
BY_NAME = {kind.name: kind for kind in FAULT_KINDS}


class ComputerFaults(FaultTable):
    """The faults in force; their durations are real seconds."""

    def __init__(self, computer: SimComputer) -> None:
        super().__init__(computer, BY_NAME)
