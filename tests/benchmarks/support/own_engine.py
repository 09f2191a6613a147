"""Processes of a benchmark on an engine of its own, in a separate domain and runtime folder."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import psutil

from tests.benchmarks.support.framework import ROOT, BenchError

_END_S: Final = 30.0
PRIORITY: Final = 5
"""Priority that config/supervisor.yaml gives the measured processes."""


def go_first(pid: int, priority: int) -> bool:
    """Sets a real-time priority, like the supervisor; before threads exist, which inherit it. pid 0: this process.

    False without the permission.
    """
    try:
        os.sched_setscheduler(pid, os.SCHED_RR, os.sched_param(priority))
    except PermissionError:
        return False
    return True


@contextmanager
def own_environment(domain: int) -> Iterator[dict[str, str]]:
    """Environment of this process and its children: own domain and runtime folder, an engine of six joints."""
    folder = Path(f"/dev/shm/robot_stack_bench-{os.getpid()}")
    own = {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROBOT_STACK_RUNTIME_DIR": str(folder),
        "ROBOT_STACK_WMX_ENGINE": "simulated",
        "ROBOT_STACK_WMX_ENGINE_CONFIG": "wmx_engine_manipulator",
    }
    before = {name: os.environ.get(name) for name in own}
    folder.mkdir(mode=0o700)
    os.environ.update(own)
    try:
        yield dict(os.environ)
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
        shutil.rmtree(folder, ignore_errors=True)


class Processes:
    """Starts modules as processes, with a real-time priority if permitted."""

    def __init__(self, environment: Mapping[str, str], priority: int) -> None:
        self._environment = dict(environment)
        self.priority = priority

    @contextmanager
    def __call__(self, *module: str) -> Iterator[psutil.Process]:
        """Runs ``python -m module`` during the block; SIGINT ends it."""
        log = Path(self._environment["ROBOT_STACK_RUNTIME_DIR"]) / f"{module[-1].rpartition('/')[2]}.log"
        command = [sys.executable, "-m", *module]
        with log.open("w") as output:
            started = subprocess.Popen(
                command, cwd=ROOT, env=self._environment, stdout=output, stderr=subprocess.STDOUT
            )
        if self.priority and not go_first(started.pid, self.priority):
            self.priority = 0
        try:
            yield psutil.Process(started.pid)
            if started.poll() is not None:
                raise BenchError(f"{module[-1]} ended: {log.read_text(errors='replace')[-2000:]}")
        finally:
            started.send_signal(signal.SIGINT)
            try:
                started.wait(_END_S)
            except subprocess.TimeoutExpired:
                started.kill()
                started.wait()
