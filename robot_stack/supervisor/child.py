"""Set-up of a forked process before its node runs."""

from __future__ import annotations

import contextlib
import ctypes
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from multiprocessing import connection, parent_process
from pathlib import Path

from robot_stack.contract.model import Process
from robot_stack.core.node_record import NodeRecord
from robot_stack.ros.main import run as run_process

_PR_SET_PDEATHSIG = 1
_PR_SET_NAME = 15
# mlockall(2): present and future mappings, each page from its first access.
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4


@dataclass(frozen=True, slots=True)
class Start:
    """How to start one process.

    niceness: as in nice(2). realtime_priority: of SCHED_RR, 0 for none. lock_memory: its pages stay in memory.
    stop_grace_s: time between SIGINT and SIGKILL when the supervisor has died.
    """

    process: Process
    arguments: tuple[str, ...]  # of its command line, after the program's name
    environment: Mapping[str, str]
    log: Path
    niceness: int
    realtime_priority: int
    lock_memory: bool
    stop_grace_s: float


def run(start: Start) -> None:
    """Body of the forked process. Leaves by SystemExit with the node's exit code."""
    os.setsid()  # its own process group: Ctrl-C reaches the supervisor alone, and nothing of the process escapes `down`
    die_with_the_forkserver()
    write_to(start.log)
    _show_as(start.process.name)
    go_first(start.niceness, start.realtime_priority)
    if start.lock_memory:
        _keep_in_memory()
    os.environ.update(start.environment)
    NodeRecord(start.process.name).constructing("imports")
    sys.argv = [start.process.name, *start.arguments]
    orphaned = threading.Event()
    threading.Thread(target=_follow_the_supervisor, args=(orphaned, start.stop_grace_s), daemon=True).start()
    try:
        run_process(start.process)
    except KeyboardInterrupt:  # interrupted before the node had its own handler
        raise SystemExit(128 + signal.SIGINT) from None
    finally:
        if orphaned.is_set():  # else the supervisor ends this process's children
            os.killpg(0, signal.SIGKILL)


def go_first(niceness: int, realtime_priority: int = 0) -> None:
    """Sets the process priority. Without the privilege the robot is only slower under load."""
    if realtime_priority > 0:
        with contextlib.suppress(PermissionError):
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(realtime_priority))
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, niceness)
    # Where the kernel groups processes by session (sched(7), autogroup), nice values apply only within a session.
    with contextlib.suppress(OSError):
        Path("/proc/self/autogroup").write_text(str(niceness), encoding="ascii")


def _keep_in_memory() -> None:
    """Locks the memory: otherwise the kernel may reclaim unused pages, and the next access waits for a disk.

    Without the privilege (CAP_IPC_LOCK or LimitMEMLOCK) nothing changes.
    """
    ctypes.CDLL(None).mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT)


def die_with_the_forkserver() -> None:
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _follow_the_supervisor(orphaned: threading.Event, grace_s: float) -> None:
    """Ends this process in its safe way after its supervisor was killed: it could not be restarted or stopped."""
    supervisor = parent_process()
    if supervisor is None:
        return
    connection.wait([supervisor.sentinel])
    orphaned.set()
    # The middleware may hang while it is taken down, with the interpreter lock: no thread would run then.
    signal.alarm(math.ceil(grace_s) + 1)
    os.kill(os.getpid(), signal.SIGINT)
    with contextlib.suppress(OSError):  # the disk may be full
        print("the supervisor has died: this process stops", file=sys.stderr, flush=True)
    time.sleep(grace_s)
    os.killpg(0, signal.SIGKILL)


def write_to(log: Path) -> None:
    """Redirects the outputs to a file; a log that cannot be written is lost."""
    try:
        file = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    except OSError:
        file = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(file, stream)
    os.close(file)
    for text in (sys.stdout, sys.stderr):
        # Line-buffered, so that a killed process has logged its last lines.
        text.reconfigure(line_buffering=True)  # type: ignore[union-attr]


def name_process(name: str) -> None:
    """Sets the name that the kernel shows, of up to 15 characters."""
    ctypes.CDLL(None).prctl(_PR_SET_NAME, name.encode()[:15], 0, 0, 0)


def _show_as(name: str) -> None:
    """The name in ``ps`` and ``top``: instead of the forkserver's, which all processes would share."""
    with contextlib.suppress(OSError, ValueError, IndexError, AttributeError):
        name_process(name)
        # proc(5): fields 48 and 49 of stat bound the memory that holds the command line; field 2 may contain spaces.
        fields = Path("/proc/self/stat").read_text(encoding="ascii").rpartition(")")[2].split()
        begin, end = int(fields[45]), int(fields[46])
        title = f"robot-stack: {name}".encode()[: end - begin - 1]
        if begin and title:
            ctypes.memset(begin, 0, end - begin)
            ctypes.memmove(begin, title, len(title))
