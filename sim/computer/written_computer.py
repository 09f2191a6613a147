"""A simulated computer in files of the kernel's formats, read by the real code."""

from __future__ import annotations

import time
from pathlib import Path

from robot_stack.core.atomic_file import replace_file

_TICKS_PER_S = 100
_CORES = 4


class WrittenComputer:
    """proc replaces /proc, thermal /sys/class/thermal. ``tick`` advances the time.

    cpu_percent, memory_percent, celsius: values from the next ``tick`` on; celsius None: no thermal zone.
    """

    def __init__(self, folder: Path) -> None:
        self.proc, self.thermal = folder / "proc", folder / "thermal"
        (self.proc / "pressure").mkdir(parents=True, exist_ok=True)
        self.thermal.mkdir(exist_ok=True)
        self.cpu_percent, self.memory_percent = 20.0, 40.0
        self.celsius: float | None = 50.0
        self._busy_ticks = self._idle_ticks = 1e6
        self._ticked_s = time.monotonic()
        for name in ("cpu", "io", "memory"):
            replace_file(
                self.proc / "pressure" / name, "some avg10=1.50 avg60=0.00 avg300=0.00 total=12345\n", durable=False
            )
        self.tick()

    def tick(self) -> None:
        """Advances the kernel's counters. Call at 20 Hz or more."""
        now_s = time.monotonic()
        ticks = (now_s - self._ticked_s) * _TICKS_PER_S * _CORES
        self._ticked_s = now_s
        self._busy_ticks += 0.01 * self.cpu_percent * ticks
        self._idle_ticks += (1.0 - 0.01 * self.cpu_percent) * ticks
        counters = f"{self._busy_ticks:.0f} 0 0 {self._idle_ticks:.0f} 0 0 0 0 0 0"
        replace_file(self.proc / "stat", f"cpu  {counters}\ncpu0 {counters}\nbtime 1700000000\n", durable=False)
        replace_file(self.proc / "meminfo", _meminfo(self.memory_percent), durable=False)
        self._write_zone()

    def _write_zone(self) -> None:
        zone = self.thermal / "thermal_zone0"
        celsius = self.celsius  # another thread may change it
        if celsius is None:
            for name in ("temp", "type"):
                (zone / name).unlink(missing_ok=True)
            return
        zone.mkdir(exist_ok=True)
        replace_file(zone / "type", "x86_pkg_temp\n", durable=False)
        replace_file(zone / "temp", f"{1000.0 * celsius:.0f}\n", durable=False)


def _meminfo(percent: float) -> str:
    total_kb = 8_000_000
    available_kb = round(total_kb * (1.0 - 0.01 * percent))
    rows = {"MemTotal": total_kb, "MemFree": available_kb, "MemAvailable": available_kb, "Buffers": 0, "Cached": 0}
    rows |= {"Active": 0, "Inactive": 0, "Shmem": 0, "Slab": 0}
    return "".join(f"{name}: {value} kB\n" for name, value in rows.items())
