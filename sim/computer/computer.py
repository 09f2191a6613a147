"""The computer as a whole, on real time."""

from __future__ import annotations

import shutil
import time
from pathlib import Path

from robot_stack.core.runtime import touch_screen_url
from sim.computer.disk import Disk
from sim.computer.params import SimComputerParams
from sim.computer.screen import Screen
from sim.computer.written_computer import WrittenComputer


class SimComputer:
    """folder: for its files, made anew. home: a folder on the machine's own file system.

    kernel: its kernel's data; disk: for recordings; screen: the browser on it.
    """

    def __init__(self, params: SimComputerParams, folder: Path, home: Path) -> None:
        self.params, self._folder = params, folder
        shutil.rmtree(folder, ignore_errors=True)  # of one that was killed
        self.kernel = WrittenComputer(folder)
        self.kernel.cpu_percent, self.kernel.memory_percent = params.cpu_percent, params.memory_percent
        self.kernel.celsius = params.celsius
        self.kernel.tick()
        self.disk = Disk(folder / "disk", home, folder / "small_disk", params.disk_bytes)
        self.screen = Screen(self.address, params.page_period_s)

    @staticmethod
    def address() -> str | None:
        """Address of touch_ui."""
        return touch_screen_url()

    @property
    def time_s(self) -> float:
        return time.monotonic()

    def close(self) -> None:
        self.screen.close()
        self.disk.close()
        shutil.rmtree(self._folder, ignore_errors=True)
