"""How long processes that have fallen silent have waited for a processor: a busy machine looks like a hung process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

# Silence that is worth a look: some heartbeats are missing.
SUSPICIOUS_S = 0.6


@dataclass(frozen=True, slots=True)
class Turns:
    """Of a process's main thread. waited_s: ready to run without a processor, up to its last turn. count: turns it had.
    runnable: it would run now.
    """

    waited_s: float
    count: int
    runnable: bool


def turns(pid: int) -> Turns | None:
    """None where the kernel does not tell, or the process is gone. Source: proc(5), the kernel's sched-stats."""
    folder = Path(f"/proc/{pid}")
    try:
        _, waited_ns, count = (folder / "schedstat").read_text(encoding="ascii").split()
        # The name in parentheses may hold anything.
        state = (folder / "stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()[0]
        return Turns(1e-9 * int(waited_ns), int(count), state == "R")
    except (OSError, IndexError, ValueError):
        return None


class Starvation:
    """What silent processes have waited since their silence was first looked at. read: of a process, as ``turns``."""

    def __init__(self, read: Callable[[int], Turns | None] = turns) -> None:
        self._read = read
        self._first: dict[str, tuple[float, Turns]] = {}

    def of_silence(self, name: str, pid: int, silence_s: float | None, now_s: float) -> float:
        """To be asked again and again [s]. silence_s: since the last heartbeat, None before the first."""
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
