"""The rows of computer and links: from an injection at its source to /safety/status, by two real processes.

    python -m tests.benchmarks.nodes.monitor_trial FOLDER

starts system_monitor and safety_monitor in the ROS domain of the environment and prints seconds by row as JSON. Files
in FOLDER replace the kernel's data, a small file system (in the mount namespace of system_monitor) the disk, and this
process the external display and the touch screen.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from std_msgs.msg import Header

from custom_msgs.msg import EHMIStatus, SafetyStatus
from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.ros import transport
from robot_stack.ros.interfaces import interface_class, qos_profile
from robot_stack.ros.tool_node import ToolNode
from sim.computer.written_computer import WrittenComputer
from tests.benchmarks.support.framework import BenchError

ROWS = ("OVERHEAT", "CPU_HIGH", "MEMORY_HIGH", "DISK_FULL", "EHMI_LINK_LOST", "UI_LINK_LOST")
_NODE = [sys.executable, "-m", "robot_stack.ros.main"]
_READY_S, _RAISED_S = 60.0, 30.0
_PUMP_S = 0.02
_DISK_BYTES = 2**20
# The quantity of the written computer for a row, and its value.
_SHOWN = {"OVERHEAT": ("celsius", 90.0), "CPU_HIGH": ("cpu_percent", 99.0), "MEMORY_HIGH": ("memory_percent", 97.0)}


class Trial:
    """Displays and screens of a robot with a written computer. ``pump`` runs all of them."""

    def __init__(self, folder: Path) -> None:
        transport.apply()
        self._computer = WrittenComputer(folder)
        self._disk = folder / "disk"
        self._disk.mkdir()
        self._tool = ToolNode("monitor_trial")
        self._ehmi, self._ui = self._advertise(topics.EHMI_STATUS), self._advertise(topics.UI_HEARTBEAT)
        self._tool.node.create_subscription(
            SafetyStatus, topics.SAFETY_STATUS.name, self._on_status, qos_profile(topics.SAFETY_STATUS.qos)
        )
        self._faults: tuple[str, ...] | None = None
        self._alive = {"EHMI_LINK_LOST": True, "UI_LINK_LOST": True}
        self._spoke_s = 0.0
        self._processes: list[subprocess.Popen[bytes]] = []

    def close(self) -> None:
        for process in self._processes:
            process.terminate()
        for process in self._processes:
            process.wait()
        self._tool.close()

    def start(self) -> None:
        """Raises BenchError if the rows are not monitored, or one is already in force."""
        folders = {
            "proc_folder": self._computer.proc,
            "thermal_folder": self._computer.thermal,
            "disk_folder": self._disk,
        }
        arguments = [word for name, path in folders.items() for word in ("-p", f"{name}:={path}")]
        mount = f'mount -t tmpfs -o size={_DISK_BYTES} disk {self._disk} && exec "$@"'
        namespace = ["unshare", "--map-root-user", "--mount", "sh", "-c", mount, "sh"]
        rows = f"rows:=[{', '.join(('ESTOP_PRESSED', *ROWS))}]"
        expected = "expected_processes:=[ehmi_bridge, touch_ui]"
        self._start([*namespace, *_NODE, "system_monitor", "--ros-args", *arguments])
        self._start([*_NODE, "safety_monitor", "--ros-args", "-p", rows, "-p", expected])
        self._wait(lambda: self._faults == (), _READY_S, "a safety status without these faults")
        self._settle()

    def raised_s(self, code: str) -> float:
        """Seconds from the injection to the row; for a link from its last heartbeat. Removes the cause afterwards."""
        begun_s = self._spoke_s if code in self._alive else time.monotonic()
        with self._injected(code):
            self._wait(lambda: code in (self._faults or ()), _RAISED_S, code)
            taken_s = time.monotonic() - begun_s
        self._wait(lambda: self._faults == (), _RAISED_S, f"the end of {code}")
        return taken_s

    @contextlib.contextmanager
    def _injected(self, code: str) -> Iterator[None]:
        if code in self._alive:
            self._alive[code] = False
            yield
            self._alive[code] = True
        elif code in _SHOWN:
            name, value = _SHOWN[code]
            before = getattr(self._computer, name)
            setattr(self._computer, name, value)
            yield
            setattr(self._computer, name, before)
        else:
            self._fill_disk()
            yield
            self._filler.unlink()

    @property
    def _filler(self) -> Path:
        """Path of the filler file through the process in the namespace."""
        return Path(f"/proc/{self._processes[0].pid}/root") / self._disk.relative_to("/") / "filler"

    def _fill_disk(self) -> None:
        with contextlib.suppress(OSError), open(self._filler, "wb", buffering=0) as file:
            while file.write(bytes(4096)):
                pass

    # --- living ------------------------------------------------------------------------------------------------------

    def _settle(self) -> None:
        """Waits until the window of the processor load is full and all links have been received."""
        end_s = time.monotonic() + 2.0
        self._wait(lambda: time.monotonic() > end_s, _READY_S, "two seconds")
        if self._faults:
            raise BenchError(f"{', '.join(self._faults)} before anything was injected")

    def _wait(self, condition: Callable[[], bool], limit_s: float, what: str) -> None:
        end_s = time.monotonic() + limit_s
        while not condition():
            ended = [process.args for process in self._processes if process.poll() is not None]
            if ended or time.monotonic() > end_s:
                raise BenchError(f"no {what}: {f'{ended} has ended' if ended else f'within {limit_s:.0f} s'}")
            self._computer.tick()
            self._speak()
            self._tool.executor.spin_once(_PUMP_S)

    def _speak(self) -> None:
        now_s = time.monotonic()
        if now_s - self._spoke_s < 1.0:
            return
        self._spoke_s = now_s
        self._ehmi.publish(EHMIStatus(linked=self._alive["EHMI_LINK_LOST"]))
        if self._alive["UI_LINK_LOST"]:
            self._ui.publish(Header())

    def _on_status(self, message: SafetyStatus) -> None:
        self._faults = tuple(message.active_faults)

    def _advertise(self, row: Topic) -> Any:
        return self._tool.node.create_publisher(interface_class(row.type), row.name, qos_profile(row.qos))

    def _start(self, command: list[str]) -> None:
        self._processes.append(subprocess.Popen(command, stdout=subprocess.DEVNULL))


def main() -> None:
    trial = Trial(Path(sys.argv[1]).absolute())
    try:
        trial.start()
        print(json.dumps({code: trial.raised_s(code) for code in ROWS}))
    except BenchError as error:
        raise SystemExit(f"error: {error}") from error
    finally:
        trial.close()


if __name__ == "__main__":
    main()
