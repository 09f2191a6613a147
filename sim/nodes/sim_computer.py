"""Node sim_computer: the simulated robot's computer in the kernel's own formats, and its faults."""

from __future__ import annotations

from pathlib import Path

from robot_stack.contract import services, topics
from robot_stack.core.runtime import recordings_dir, runtime_dir
from robot_stack.middleware.node import StackNode
from sim.computer.computer import SimComputer
from sim.computer.faults import ComputerFaults
from sim.computer.params import SimComputerParams
from sim.nodes.fault_service import serve_faults


class SimComputerNode(StackNode):
    """Uses real time, like the computer that runs the nodes."""

    def __init__(self) -> None:
        super().__init__("sim_computer", SimComputerParams)
        folder = runtime_dir() / self.params.folder
        self._computer = self.device(SimComputer, self.params, folder, _existing(recordings_dir()))
        self.at_end.callback(self._computer.close)
        self._faults = ComputerFaults(self._computer)
        self.subscribe(topics.UI_HEARTBEAT, lambda _: self._computer.screen.on_heartbeat())
        serve_faults(self, services.INJECT_COMPUTER_FAULT, self.inject_fault)
        self.every_real(self.params.tick_rate_hz, self._tick)

    def inject_fault(self, kind: str, target: str, value: float, duration_s: float) -> str:
        """Raises FaultRefused."""
        return self._faults.inject(kind, target, value, duration_s)

    def _tick(self) -> None:
        self._faults.update()
        self._computer.kernel.tick()
        kernel = self._computer.kernel
        self.report.values["shown"] = (
            f"processor {kernel.cpu_percent:g} %, memory {kernel.memory_percent:g} %, {kernel.celsius:g} C"
        )
        self.set_health(True, "running")


def _existing(folder: Path) -> Path:
    """The folder, or the nearest one above it that is there already: it will lie on the same file system."""
    return next(path for path in (folder, *folder.parents) if path.exists())
