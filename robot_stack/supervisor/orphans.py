"""Leftovers of an earlier supervisor: processes it had started, and stale sockets.

Process ids are stored with the start time of the process, so that a reused id is never
mistaken for ours.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import socket
import stat
import time
from collections.abc import Iterable
from pathlib import Path

import psutil

from robot_stack.core.atomic_file import replace_file
from robot_stack.core.runtime import runtime_dir

_RECORD = "processes.json"
# Start times come from clock ticks (10 ms); two processes with one id are further apart than this.
_SAME_START_S = 0.5


def record(pids: Iterable[int]) -> None:
    """Records the processes of this supervisor, replacing the earlier record."""
    started = {}
    for pid in pids:
        with contextlib.suppress(psutil.Error):
            started[pid] = psutil.Process(pid).create_time()
    path = runtime_dir() / _RECORD
    replace_file(path, json.dumps(started), durable=False)


def forget() -> None:
    with contextlib.suppress(FileNotFoundError):
        (runtime_dir() / _RECORD).unlink()


def find() -> list[psutil.Process]:
    """The noted processes that still run."""
    try:
        noted = json.loads((runtime_dir() / _RECORD).read_text(encoding="ascii"))
    except (OSError, ValueError):
        return []
    alive = []
    for pid, started_s in noted.items():
        with contextlib.suppress(psutil.Error, ValueError):
            process = psutil.Process(int(pid))
            same = abs(process.create_time() - started_s) < _SAME_START_S
            if same and process.status() != psutil.STATUS_ZOMBIE:
                alive.append(process)
    return alive


def end(processes: Iterable[psutil.Process], patience_s: float) -> list[int]:
    """Interrupts the processes, kills the remaining ones after ``patience_s``. Returns the ids of all of them."""
    left = list(processes)
    ids = [process.pid for process in left]
    for process in left:
        with contextlib.suppress(psutil.Error):
            process.send_signal(signal.SIGINT)
    left = wait_ended(left, patience_s)
    for process in left:
        with contextlib.suppress(psutil.Error):
            process.kill()
    wait_ended(left, patience_s)
    return ids


def wait_ended(processes: Iterable[psutil.Process], timeout_s: float) -> list[psutil.Process]:
    """Returns the processes still running after the timeout.

    An ended process stays as a zombie until its parent collects it. If the parent is the container's first
    process, this may take long or never happen.
    """
    until_s = time.monotonic() + timeout_s
    return [process for process in processes if not _has_ended(process, until_s - time.monotonic())]


def _has_ended(process: psutil.Process, timeout_s: float) -> bool:
    try:
        descriptor = os.pidfd_open(process.pid)
    except ProcessLookupError:
        return True
    try:
        # Readable from the end on, not only from the collection on. A number that was given again is another process.
        return not process.is_running() or bool(select.select([descriptor], [], [], max(timeout_s, 0.0))[0])
    finally:
        os.close(descriptor)


def remove_stale_sockets() -> list[Path]:
    """Deletes the Unix sockets of the runtime folder without a server. Returns them."""
    return [path for path in _sockets(runtime_dir()) if _is_stale(path) and _unlink(path)]


def _sockets(folder: Path) -> list[Path]:
    found = []
    for root, _, names in os.walk(folder):
        for name in names:
            path = Path(root) / name
            with contextlib.suppress(OSError):
                if stat.S_ISSOCK(path.lstat().st_mode):
                    found.append(path)
    return found


def _is_stale(path: Path) -> bool:
    for kind in (socket.SOCK_STREAM, socket.SOCK_SEQPACKET, socket.SOCK_DGRAM):
        with socket.socket(socket.AF_UNIX, kind) as probe:
            probe.settimeout(0.2)
            try:
                probe.connect(str(path))
            except ConnectionRefusedError:
                return True
            except OSError:  # of another kind, or busy
                continue
            return False
    return False


def _unlink(path: Path) -> bool:
    with contextlib.suppress(OSError):
        path.unlink()
        return True
    return False
