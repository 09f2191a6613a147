"""The running stack that a benchmark measures: the one of this ROS domain, or one of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import psutil

from robot_stack.supervisor import client
from robot_stack.supervisor.control import NotRunning, ask
from tests.benchmarks.support.framework import BenchError

_DEADLINE_S = 60.0
_MIB = 2**20


@contextmanager
def running_stack(
    profile: str, settings: Sequence[str] = (), own: Sequence[str] = (), *, system_time: bool = False
) -> Iterator[dict[str, Any]]:
    """Status of a stack whose processes are all ready: the running one, else one that ends with the benchmark.

    settings: parameters required by the benchmark; with them, a running stack is refused.
    own: parameters of a stack that is started here; a running one is used unchanged.
    system_time: nodes use the system clock, for measurements in real time; a running stack with another clock is
        refused.
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
        if system_time and status["use_sim_time"]:
            raise BenchError(
                "this benchmark measures real time; the running stack uses the world's clock: `robot-stack down`"
            )
        yield status
        return
    try:
        yield client.start(client.Launch(profile, [*settings, *own], system_time=system_time), _DEADLINE_S)
    except client.StartError as error:
        raise BenchError(str(error)) from error
    finally:
        with suppress(NotRunning):  # it may have died
            client.stop()


@contextmanager
def busy_loops(count: int) -> Iterator[None]:
    """``count`` foreign processes at ordinary priority that never wait, in a session of their own.

    They end with this process, even if it is killed.
    """
    # The benchmark's real-time priority must not be inherited.
    ordinary = "import os; os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))"
    command = [sys.executable, "-c", f"{ordinary}\nwhile os.getppid() == {os.getpid()}: pass"]
    loops = [subprocess.Popen(command, start_new_session=True) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


class ProcessLoad:
    """CPU of one process since the construction of this object."""

    def __init__(self, process: psutil.Process) -> None:
        self._process = process
        self._before_s, self._begun_s = _cpu_s(process), time.monotonic()

    def cpu_pct(self) -> float:
        """Percent of one core."""
        return 100.0 * (_cpu_s(self._process) - self._before_s) / (time.monotonic() - self._begun_s)


def _cpu_s(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


def cpu_pct(process: psutil.Process, duration_s: float) -> float:
    """CPU of a process during ``duration_s``, percent of one core."""
    load = ProcessLoad(process)
    time.sleep(duration_s)
    return load.cpu_pct()


def pss_mb(process: psutil.Process) -> float:
    """Proportional set size: shared memory counts once."""
    return float(process.memory_full_info().pss) / _MIB


class Load:
    """CPU and memory of a stack: its processes, the supervisor and the forkserver."""

    def __init__(self, status: dict[str, Any]) -> None:
        supervisor = psutil.Process(status["pid"])
        self._processes = [supervisor, *supervisor.children(recursive=True)]
        self._names = {item["pid"]: item["name"] for item in status["processes"]}
        self._before_s = self._cpu_s()

    def _cpu_s(self) -> dict[str, float]:
        used_s: dict[str, float] = {}
        for process in self._processes:
            name = self._names.get(process.pid, "supervisor")
            used_s[name] = used_s.get(name, 0.0) + _cpu_s(process)
        return used_s

    def cores_by_process(self, elapsed_s: float) -> dict[str, float]:
        """Cores used since the beginning, ``elapsed_s`` ago; the supervisor's with its forkserver."""
        return {name: (used_s - self._before_s[name]) / elapsed_s for name, used_s in self._cpu_s().items()}

    def pss_mb(self) -> float:
        return sum(pss_mb(process) for process in self._processes)
