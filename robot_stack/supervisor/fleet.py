"""The operating-system processes of the stack, forked from a server that has imported everything already."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Iterable, Mapping
from multiprocessing import forkserver
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Any

import psutil
import yaml

from robot_stack.contract.model import Process
from robot_stack.core.runtime import runtime_dir
from robot_stack.supervisor import child, orphans, preload
from robot_stack.supervisor.params import SupervisorParams
from robot_stack.supervisor.profile import Plan

# Nodes write to their own log; rcl's copy of it would go to another folder.
_ROS_ARGUMENTS = ("--disable-external-lib-logs",)


class Fleet:
    """Starts and ends processes. The lifecycle decides when."""

    def __init__(self, plan: Plan, run_dir: Path, params: SupervisorParams) -> None:
        self._run_dir = run_dir
        self._params = params
        self._environment = dict(plan.environment)
        # Written once: a restart must not depend on a disk.
        self._arguments = {p.name: _arguments(p, plan.parameters) for p in plan.processes}
        self._context = multiprocessing.get_context("forkserver")
        self._processes: dict[str, ForkServerProcess] = {}
        self._server: psutil.Process | None = None  # that has imported everything
        os.environ[preload.MODULES_VARIABLE] = ",".join(p.module for p in plan.processes if p.module)
        self._context.set_forkserver_preload([preload.__name__])
        forkserver.ensure_running()

    def ready(self) -> bool:
        """True if ``start`` does not have to wait for the server's imports. A server that has ended is replaced."""
        forkserver.ensure_running()
        if self._server is None or not self._server.is_running():
            self._server = None
            with contextlib.suppress(psutil.Error):
                children = psutil.Process().children()
                self._server = next((child for child in children if child.name() == preload.SERVER_NAME), None)
        return self._server is not None

    def start(self, process: Process) -> int | None:
        """Forks the process. Returns its id; None if the server has just ended."""
        start = child.Start(
            process=process,
            arguments=self._arguments[process.name],
            environment=self._environment,
            log=self._run_dir / f"{process.name}.log",
            niceness=self._params.niceness[process.criticality],
            realtime_priority=self._params.realtime_priority.get(process.name, 0),
            lock_memory=self._params.lock_memory[process.criticality],
            stop_grace_s=self._params.terminate_s,
        )
        forked = self._context.Process(target=child.run, args=(start,), name=process.name)
        try:
            forked.start()
        except (EOFError, OSError):
            return None
        self._processes[process.name] = forked
        orphans.record(self.pids().values())
        assert forked.pid is not None
        return forked.pid

    def pids(self) -> dict[str, int]:
        """The processes that have been started and not been collected: name -> id."""
        return {name: forked.pid for name, forked in self._processes.items() if forked.pid is not None}

    def sentinels(self) -> dict[int, str]:
        """File descriptor that becomes readable when the process ends -> name."""
        return {int(forked.sentinel): name for name, forked in self._processes.items()}

    def collect(self, name: str) -> int | None:
        """The exit code of an ended process (negative: the signal), which is then dropped. None: still running."""
        forked = self._processes[name]
        code = forked.exitcode
        if code is None:
            return None
        assert forked.pid is not None
        # Its own children end with it.
        _signal_group(forked.pid, signal.SIGKILL)
        forked.close()
        del self._processes[name]
        return code

    def signal(self, names: Iterable[str], number: signal.Signals) -> None:
        for name in names:
            pid = self._processes[name].pid
            assert pid is not None
            # SIGINT to the node alone, which may have to end children of its own in an order.
            if number is signal.SIGINT or not _signal_group(pid, number):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, number)


def _arguments(process: Process, overrides: Mapping[str, Mapping[str, Any]]) -> tuple[str, ...]:
    """overrides: parameters in force instead of the files', by node; they go into a ROS parameter file in memory."""
    tree = {
        node: {"ros__parameters": {key: ros_value(value) for key, value in overrides[node].items()}}
        for node in process.nodes
        if node in overrides
    }
    if not tree:
        return ("--ros-args", *_ROS_ARGUMENTS)
    path = runtime_dir() / f"{process.name}.parameters.yaml"
    path.write_text(yaml.safe_dump(tree), encoding="utf-8")
    return ("--ros-args", *_ROS_ARGUMENTS, "--params-file", str(path))


def ros_value(value: Any) -> Any:
    """ROS takes a sequence of one type only: whole numbers among others become floats."""
    if isinstance(value, list) and any(isinstance(item, float) for item in value):
        return [float(item) if type(item) is int else item for item in value]
    return value


def _signal_group(pid: int, number: signal.Signals) -> bool:
    """False if there is no such group: all have ended, or the process is too young to have made it."""
    try:
        os.killpg(pid, number)
    except ProcessLookupError:
        return False
    except PermissionError:  # only a zombie is left, which the forkserver has not collected yet
        return True
    return True
