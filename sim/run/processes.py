"""The processes of the stack, for faults that kill and stop them."""

from __future__ import annotations

import contextlib
import os
import signal
from pathlib import Path

from robot_stack.core.node_record import NodeRecords
from sim.plant.fault_table import FaultRefused

_ENDED = ("Z", "X")


class Processes:
    """Of this ROS domain, by the name of their node. Raises FaultRefused for a name that has none."""

    def __init__(self) -> None:
        self._records = NodeRecords()
        self._stopped: dict[str, int] = {}

    def kill(self, name: str) -> None:
        self._signal(name, self._pid(name), signal.SIGKILL)

    def stop(self, name: str) -> None:
        """Stops the process: the world does not wait for it."""
        pid = self._pid(name)
        self._stopped[name] = pid
        self._signal(name, pid, signal.SIGSTOP)

    def resume(self, name: str) -> None:
        """Ends ``stop``. The supervisor may have replaced the process meanwhile."""
        pid = self._stopped.pop(name, None)
        if pid is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)

    def takes_part(self, name: str) -> bool:
        """The node is in another process than this, which has not ended and is not stopped by a fault."""
        state = self._records.read(name)
        if state is None or state.pid == os.getpid() or state.pid in self._stopped.values():
            return False
        return process_runs(state.pid)

    def _pid(self, name: str) -> int:
        state = self._records.read(name)
        if state is None or not process_runs(state.pid):
            raise FaultRefused(f"no process of a node {name!r} runs in this ROS domain")
        if state.pid == os.getpid():
            raise FaultRefused(f"{name} is the world's own process; send it a signal instead")
        return state.pid

    @staticmethod
    def _signal(name: str, pid: int, number: signal.Signals) -> None:
        try:
            os.kill(pid, number)
        except (ProcessLookupError, PermissionError) as error:
            raise FaultRefused(f"{name}: {error}") from None


def process_runs(pid: int) -> bool:
    """False for one that has ended, even before it is reaped."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] not in _ENDED
