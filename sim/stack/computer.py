"""The robot's computer on the scheduler: the system monitor's readings of it, and its faults.

Counterparts of ``sim.computer.computer.SimComputer`` and of the readers in
``robot_stack.system_monitor.nodes.computer_reader``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from robot_stack.system_monitor.computer import CpuTimes, ProcessFigures
from sim.computer.params import SimComputerParams

_DISK_PERCENT, _FULL_PERCENT = 40.0, 100.0
ADDRESS = "simulated://touch_ui/"


@dataclass(slots=True)
class Kernel:
    """Values of its kernel."""

    cpu_percent: float = 0.0
    memory_percent: float = 0.0
    celsius: float | None = None

    def tick(self) -> None:
        """Does nothing: values are constant between two readings."""


class Disk:
    def __init__(self) -> None:
        self.full = False

    def fill(self) -> None:
        self.full = True

    def empty(self) -> None:
        self.full = False


class ScreenSwitch:
    """Whether a page is open on the robot's own screen; ``on_change`` opens and closes it. See ``Screen``."""

    # A page counts as seen after this many heartbeats of touch_ui.
    _SEEN = 2

    def __init__(self) -> None:
        self.on_change: Callable[[bool], None] = lambda _: None
        self._shown = self._lost = False
        self._heartbeats = 0

    def show(self) -> None:
        self._lost = False
        if not self._shown:
            self._shown, self._heartbeats = True, 0
            self.on_change(True)

    def lose(self) -> None:
        """Closes the page; without one, a page opens first and closes once it has been seen."""
        self.show()
        self._lost = True
        self._close_if_seen()

    def on_heartbeat(self) -> None:
        """A heartbeat of touch_ui."""
        self._heartbeats += 1
        self._close_if_seen()

    def _close_if_seen(self) -> None:
        if self._lost and self._shown and self._heartbeats >= self._SEEN:
            self._shown = False
            self.on_change(False)


@dataclass(slots=True)
class ScheduledComputer:
    """now_s: virtual time."""

    now_s: Callable[[], float]
    params: SimComputerParams | None = None
    kernel: Kernel = field(default_factory=Kernel)
    disk: Disk = field(default_factory=Disk)
    screen: ScreenSwitch = field(default_factory=ScreenSwitch)

    def power_on(self, params: SimComputerParams, folder: Path, home: Path) -> ScheduledComputer:
        """Sets the state of a new ``SimComputer``."""
        self.params = params
        self.kernel.cpu_percent, self.kernel.memory_percent = params.cpu_percent, params.memory_percent
        self.kernel.celsius = params.celsius
        return self

    @staticmethod
    def address() -> str | None:
        return ADDRESS

    @property
    def time_s(self) -> float:
        return self.now_s()

    def close(self) -> None:
        """Does nothing: no resource is open."""


class ScheduledReader:
    """See ``ComputerReader``. The processor's counters are those of its use since the start."""

    def __init__(self, computer: ScheduledComputer) -> None:
        self._computer = computer
        self._busy_s, self._total_s = 1e4, 2e4
        self._read_s = computer.now_s()

    def cpu(self) -> CpuTimes | None:
        now_s = self._computer.now_s()
        passed_s, self._read_s = now_s - self._read_s, now_s
        self._busy_s += 0.01 * self._computer.kernel.cpu_percent * passed_s
        self._total_s += passed_s
        return CpuTimes(self._busy_s, self._total_s)

    def memory_percent(self) -> float:
        return self._computer.kernel.memory_percent

    def disk_percent(self) -> float:
        return _FULL_PERCENT if self._computer.disk.full else _DISK_PERCENT

    def find_disk(self) -> None:
        """Does nothing: the disk always exists."""

    def zones(self) -> dict[str, float]:
        celsius = self._computer.kernel.celsius
        return {} if celsius is None else {"thermal_zone0 x86_pkg_temp": celsius}

    def pressure(self) -> dict[str, float]:
        return {}


class NoProcesses:
    """See ``ProcessReader``: the nodes share one process, which does not represent a robot."""

    def read(self) -> list[ProcessFigures]:
        return []

    def read_pss(self) -> None:
        """Nothing is read."""
