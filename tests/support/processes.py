"""Real node processes for tests; each is always ended by its pid."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.support.forks import Forked
from tests.support.waiting import DEADLINE_S, wait_for

ROOT = Path(__file__).resolve().parents[2]


class NodeProcess:
    """A started process with its output in a file.

    preload: a library that the linker loads before all others; such a process cannot be forked from a running one.
    """

    def __init__(self, command: list[str], log: Path, preload: Path | None = None) -> None:
        self.log = log
        log.touch()
        self.process = Forked(command, ROOT, log) if preload is None else _fresh(command, log, preload)

    @property
    def pid(self) -> int:
        return self.process.pid

    def output(self) -> str:
        return self.log.read_text(errors="replace")

    def running(self) -> bool:
        return self.process.poll() is None

    def wait(self, deadline_s: float = DEADLINE_S) -> int:
        """The exit code. Raises AssertionError with the output if the process does not end in time."""
        try:
            return self.process.wait(deadline_s)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"process {self.pid} did not end within {deadline_s} s:\n{self.output()}") from None

    def signal(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    def wait_output(self, text: str, deadline_s: float = DEADLINE_S) -> None:
        wait_for(lambda: text in self.output() or not self.running(), f"{text!r} in the output", deadline_s)
        assert text in self.output(), f"process ended with {self.process.returncode}:\n{self.output()}"

    def stop(self) -> None:
        """SIGINT, then SIGKILL after 5 s. Safe to call on a process that has ended."""
        if self.running():
            self.process.send_signal(signal.SIGINT)
            end_s = time.monotonic() + 5.0
            while self.running() and time.monotonic() < end_s:
                time.sleep(0.02)
            if self.running():
                self.process.kill()
        self.process.wait()


def _fresh(command: list[str], log: Path, preload: Path) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "LD_PRELOAD": str(preload)}
    with log.open("ab") as output:
        return subprocess.Popen(command, cwd=ROOT, env=environment, stdout=output, stderr=output)


def node_command(name: str, *ros_args: str) -> list[str]:
    """The command of a contract process; ``ros_args`` follow --ros-args."""
    return [sys.executable, "-m", "robot_stack.ros.main", name, *(("--ros-args", *ros_args) if ros_args else ())]


Start = Callable[..., NodeProcess]


@contextmanager
def started_processes(folder: Path) -> Iterator[Start]:
    """``start(name, *ros_args)`` starts a contract process, ``start(command=[...])`` any; the end stops them all.

    folder: for their output.
    """
    started: list[NodeProcess] = []

    def start(name: str = "process", *ros_args: str, command: list[str] | None = None) -> NodeProcess:
        log = folder / f"{len(started)}-{name}.log"
        started.append(NodeProcess(command or node_command(name, *ros_args), log))
        return started[-1]

    yield start
    for process in reversed(started):
        process.stop()
