"""Waiting time of silent processes for a processor: on a busy machine a starved process looks hung."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

# Silence from which waiting time is measured: some missing heartbeats.
SUSPICIOUS_S = 0.6
_NICENESS = 16  # in /proc/PID/stat, behind the name


@dataclass(frozen=True, slots=True)
class Turns:
    """Scheduling of a thread. waited_s: time runnable without a processor, up to its last turn. count: number of turns.
    runnable: it is runnable now.
    """

    waited_s: float
    count: int
    runnable: bool


def turns(pid: int) -> dict[str, Turns]:
    """By thread, the main thread and those of its priority or a higher one: it may wait for a lock that one of them
    holds. Empty if the kernel does not report it, or the process has ended. Source: proc(5), the kernel's sched-stats.
    """
    found: dict[str, tuple[Turns, int]] = {}
    try:
        for folder in Path(f"/proc/{pid}/task").iterdir():
            with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # it has just ended
                found[folder.name] = _thread(folder)
        _, niceness = found[str(pid)]
    except (OSError, LookupError, ValueError):
        return {}
    return {thread: seen for thread, (seen, own) in found.items() if own <= niceness}


def _thread(folder: Path) -> tuple[Turns, int]:
    """A thread's turns and niceness."""
    _, waited_ns, count = (folder / "schedstat").read_text(encoding="ascii").split()
    # The name in parentheses may hold anything.
    fields = (folder / "stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
    return Turns(1e-9 * int(waited_ns), int(count), fields[0] == "R"), int(fields[_NICENESS])


class Starvation:
    """Waiting time of silent processes since the first measurement of their silence. read: see ``turns``."""

    def __init__(self, read: Callable[[int], dict[str, Turns]] = turns) -> None:
        self._read = read
        self._first: dict[str, tuple[float, dict[str, Turns]]] = {}

    def of_silence(self, name: str, pid: int, silence_s: float | None, now_s: float) -> float:
        """The longest waiting time of a thread [s]. Call repeatedly. silence_s: since the last heartbeat, None before
        the first.
        """
        if silence_s is None or silence_s < SUSPICIOUS_S:
            self._first.pop(name, None)
            return 0.0
        now = self._read(pid)
        if not now:
            return 0.0
        first_s, first = self._first.setdefault(name, (now_s, now))
        return max(
            (_waited_s(first[thread], now[thread], now_s - first_s) for thread in first if thread in now), default=0.0
        )


def _waited_s(first: Turns, now: Turns, between_s: float) -> float:
    if now.count == first.count and now.runnable:  # the kernel counts a wait when it has ended
        return between_s
    return max(0.0, now.waited_s - first.waited_s)
