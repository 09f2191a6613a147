"""The running stack that a benchmark measures: the one of this ROS domain, or one of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import psutil

from robot_stack.bench.framework import BenchError
from robot_stack.supervisor import client
from robot_stack.supervisor.control import NotRunning, ask

_DEADLINE_S = 60.0
_MIB = 2**20


@contextmanager
def running_stack(profile: str, settings: Sequence[str] = (), own: Sequence[str] = ()) -> Iterator[dict[str, Any]]:
    """Status of a stack whose processes are all ready: the one that runs, else one that ends with the benchmark.

    settings: parameters without which the benchmark measures something else; with them, a running stack is refused.
    own: parameters of a stack that is started here; a running one is taken as it is.
    """
    try:
        status = ask("status")
    except NotRunning:
        status = {}
    if status and settings:
        raise BenchError(f"this benchmark starts its own stack, with {', '.join(settings)}: `robot-stack down` first")
    if status:
        if not status["ready"]:
            raise BenchError(client.not_ready(status))
        yield status
        return
    try:
        yield client.start(client.Launch(profile, [*settings, *own]), _DEADLINE_S)
    except client.StartError as error:
        raise BenchError(str(error)) from error
    finally:
        with suppress(NotRunning):  # it may have died
            client.stop()


class Load:
    """CPU and memory of a stack: its processes, the supervisor and the forkserver."""

    def __init__(self, status: dict[str, Any]) -> None:
        supervisor = psutil.Process(status["pid"])
        self._processes = [supervisor, *supervisor.children(recursive=True)]
        self._before_s = self._cpu_s()

    def _cpu_s(self) -> float:
        total_s = 0.0
        for process in self._processes:
            times = process.cpu_times()
            total_s += times.user + times.system
        return total_s

    def cpu_cores(self, elapsed_s: float) -> float:
        """Cores used since the beginning, ``elapsed_s`` ago."""
        return (self._cpu_s() - self._before_s) / elapsed_s

    def pss_mb(self) -> float:
        """Proportional memory: what is shared counts once."""
        return float(sum(process.memory_full_info().pss for process in self._processes)) / _MIB
