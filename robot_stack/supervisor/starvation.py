"""Waiting time of silent processes for a processor: on a busy machine a starved process looks hung."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

# Silence from which waiting time is measured: some missing heartbeats.
SUSPICIOUS_S = 0.6


@dataclass(frozen=True, slots=True)
class Turns:
    """Scheduling of a process's main thread. waited_s: time runnable without a processor, up to its last turn. count:
    number of turns. runnable: it is runnable now.
    """

    waited_s: float
    count: int
    runnable: bool


def turns(pid: int) -> Turns | None:
    """None if the kernel does not report it, or the process has ended. Source: proc(5), the kernel's sched-stats."""
    folder = Path(f"/proc/{pid}")
    try:
        _, waited_ns, count = (folder / "schedstat").read_text(encoding="ascii").split()
        # The name in parentheses may hold anything.
        state = (folder / "stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()[0]
        return Turns(1e-9 * int(waited_ns), int(count), state == "R")
    except (OSError, IndexError, ValueError):
        return None


class Starvation:
    """Waiting time of silent processes since the first measurement of their silence. read: see ``turns``."""

    def __init__(self, read: Callable[[int], Turns | None] = turns) -> None:
        self._read = read
        self._first: dict[str, tuple[float, Turns]] = {}

    def of_silence(self, name: str, pid: int, silence_s: float | None, now_s: float) -> float:
        """Call repeatedly [s]. silence_s: since the last heartbeat, None before the first."""
        if silence_s is None or silence_s < SUSPICIOUS_S:
            self._first.pop(name, None)
            return 0.0
        now = self._read(pid)
        if now is None:
            return 0.0
        first_s, first = self._first.setdefault(name, (now_s, now))
        if now.count == first.count and now.runnable:  # the kernel counts a wait when it has ended
            return now_s - first_s
        return max(0.0, now.waited_s - first.waited_s)
