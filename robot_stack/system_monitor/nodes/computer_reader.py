"""Reads the kernel's figures of the computer with psutil and from the files of thermal zones and pressure."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

from robot_stack.core.node_record import NodeRecords
from robot_stack.core.runtime import recordings_dir, runtime_dir
from robot_stack.system_monitor.computer import CpuTimes, ProcessFigures, celsius_of, pressure_avg10
from robot_stack.system_monitor.params import SystemMonitorParams

_MIB = 2**20
_KERNEL = "/proc"
PRESSURES = ("cpu", "io", "memory")


class ComputerReader:
    """Unreadable values are NaN or missing, whatever the reason. disk_folder need not exist yet."""

    def __init__(self, proc_folder: Path, thermal_folder: Path, disk_folder: Path) -> None:
        self._proc, self._thermal = proc_folder, thermal_folder
        self._wanted_disk, self._disk = disk_folder, disk_folder
        self.find_disk()

    def cpu(self) -> CpuTimes | None:
        with suppress(OSError, ValueError, IndexError), _path_in_errors(self._proc):
            times = psutil.cpu_times()
            # The kernel already includes guest time in user and nice.
            total_s = math.fsum(times) - getattr(times, "guest", 0.0) - getattr(times, "guest_nice", 0.0)
            return CpuTimes(total_s - times.idle - getattr(times, "iowait", 0.0), total_s)
        return None

    def memory_percent(self) -> float:
        with suppress(OSError, ValueError, KeyError, ZeroDivisionError), _path_in_errors(self._proc):
            return float(psutil.virtual_memory().percent)
        return math.nan

    def disk_percent(self) -> float:
        """Usage of the space available to ordinary users."""
        with suppress(OSError):
            usage = psutil.disk_usage(str(self._disk))
            return float(usage.percent) if usage.total else math.nan
        return math.nan

    def find_disk(self) -> None:
        """A missing folder will be created in its nearest existing parent."""
        folders = (self._wanted_disk, *self._wanted_disk.parents)
        self._disk = next((path for path in folders if path.exists()), Path("/"))

    def zones(self) -> dict[str, float]:
        """Degrees Celsius by zone: the kernel's number and type."""
        found = {}
        for zone in sorted(self._thermal.glob("thermal_zone*")):
            with suppress(OSError):  # a sleeping sensor returns an error
                celsius = celsius_of((zone / "temp").read_text(encoding="ascii", errors="replace"))
                found[f"{zone.name} {_kind(zone)}".strip()] = celsius
        return found

    def pressure(self) -> dict[str, float]:
        """% of the last 10 s in which a task was stalled by each resource; empty on a kernel without this statistic."""
        found = {}
        for name in PRESSURES:
            with suppress(OSError):
                found[name] = pressure_avg10((self._proc / "pressure" / name).read_text(encoding="ascii"))
        return found


def configured_reader(params: SystemMonitorParams) -> ComputerReader:
    disk = _folder(params.disk_folder) if params.disk_folder else recordings_dir()
    return ComputerReader(_folder(params.proc_folder), _folder(params.thermal_folder), disk)


def _folder(name: str) -> Path:
    """Path of a folder: relative to the runtime folder unless absolute."""
    return runtime_dir() / Path(name).expanduser()


@contextmanager
def _path_in_errors(proc_folder: Path) -> Iterator[None]:
    """Redirects psutil to the folder for a moment; the stack's processes need the real one."""
    psutil.PROCFS_PATH = str(proc_folder)
    try:
        yield
    finally:
        psutil.PROCFS_PATH = _KERNEL


def _kind(zone: Path) -> str:
    try:
        return (zone / "type").read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""


class ProcessReader:
    """CPU and memory of the stack's processes, which their records in shared memory name."""

    def __init__(self, nodes: tuple[str, ...]) -> None:
        self._nodes = nodes
        self._records = NodeRecords()
        self._processes: dict[str, psutil.Process] = {}
        self._pss_mb: dict[int, float] = {}

    def read(self) -> list[ProcessFigures]:
        """The running processes. A process of several nodes is listed once, by its first node."""
        return [figures for name, pid in self._pids().items() if (figures := self._read(name, pid)) is not None]

    def read_pss(self) -> None:
        """Proportional memory: shared pages are divided among their users. Takes ten times as long as the rest."""
        self._pss_mb = {}
        for process in self._processes.values():
            with suppress(psutil.Error, OSError):
                self._pss_mb[process.pid] = process.memory_full_info().pss / _MIB

    def _pids(self) -> dict[str, int]:
        pids: dict[str, int] = {}
        for name in self._nodes:
            state = self._records.read(name)
            if state is not None and state.pid not in pids.values():
                pids[name] = state.pid
        return pids

    def _read(self, name: str, pid: int) -> ProcessFigures | None:
        try:
            process, known = self._processes.get(name), True
            if process is None or process.pid != pid:
                process, known = psutil.Process(pid), False
                self._processes[name] = process
            with process.oneshot():
                cpu_percent = process.cpu_percent()
                rss_mb = process.memory_info().rss / _MIB
        except (psutil.Error, OSError):
            self._processes.pop(name, None)
            return None
        return ProcessFigures(name, cpu_percent if known else math.nan, rss_mb, self._pss_mb.get(pid, math.nan))
