"""A node's state in shared memory, for this machine: alive, ready, being constructed, up to date.

Seventeen heartbeats at 5 Hz to two receivers cost more by DDS than what they report on. Receivers on other machines,
or outside the stack, use ``/system/heartbeat``. A node's record stays when its process dies; ``pid`` identifies the
process that wrote it.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from robot_stack.core.runtime import runtime_dir
from robot_stack.core.shared_page import SharedPage

_PID, _BEATS, _BEAT_NS, _READY = range(4)
_WORDS = 4
_DUE_NS = 0
_SINGLES = 1
_TEXT_BYTES = 208
_NEVER = 2**62


def _folder() -> Path:
    return runtime_dir() / "nodes"


@dataclass(frozen=True, slots=True)
class NodeState:
    """One node at one moment.

    beats: heartbeats from its own loop; 0 while it is being constructed. beat_s: monotonic time of the last one.
    text: what it waits for or is being constructed with; empty once it is ready.
    due_s: on the node's clock, the earliest time at which its loop has something to do; infinite while it has nothing.
    """

    pid: int
    beats: int
    beat_s: float
    ready: bool
    text: str
    due_s: float


class NodeRecord:
    """Written by the node's process alone.

    pid: None for this process's own. monotonic_ns: the computer's monotonic clock. The deterministic scheduler, which
    has many nodes in one process, passes its own.
    """

    def __init__(self, name: str, pid: int | None = None, monotonic_ns: Callable[[], int] = time.monotonic_ns) -> None:
        _folder().mkdir(exist_ok=True)
        self._pid, self._monotonic_ns = pid, monotonic_ns
        self._page = SharedPage(_folder() / name, _WORDS, _SINGLES, _TEXT_BYTES, create=True)

    def constructing(self, text: str) -> None:
        """Records what the node is busy with before its loop runs."""
        self._write(0, False, text)
        self.due(math.inf)

    def beat(self, ready: bool, text: str) -> None:
        self._write(max(self._page.read()[_BEATS], 0) + 1, ready, text)

    def due(self, due_s: float) -> None:
        self._page.set_single(_DUE_NS, _NEVER if due_s == math.inf else int(1e9 * due_s))

    def close(self) -> None:
        self._page.close()

    def _write(self, beats: int, ready: bool, text: str) -> None:
        with self._page.writing() as words:
            words[_PID] = os.getpid() if self._pid is None else self._pid
            words[_BEATS], words[_BEAT_NS], words[_READY] = beats, self._monotonic_ns(), ready
            self._page.text = text


class NodeRecords:
    """The records of this domain's nodes, for readers."""

    def __init__(self) -> None:
        self._pages: dict[str, SharedPage] = {}

    def read(self, name: str) -> NodeState | None:
        """None for a node that has never been started here."""
        page = self._pages.get(name) or self._open(name)
        if page is None:
            return None
        pid, beats, beat_ns, ready = page.read()
        if not pid:
            return None
        text, due_ns = "" if ready else page.text, page.single(_DUE_NS)
        return NodeState(pid, beats, 1e-9 * beat_ns, bool(ready), text, math.inf if due_ns == _NEVER else 1e-9 * due_ns)

    def due_s(self, name: str) -> float:
        """``NodeState.due_s`` alone, which costs a tenth of ``read``; infinite for a node without a record."""
        page = self._pages.get(name) or self._open(name)
        due_ns = _NEVER if page is None else page.single(_DUE_NS)
        return math.inf if due_ns == _NEVER else 1e-9 * due_ns

    def _open(self, name: str) -> SharedPage | None:
        try:
            self._pages[name] = SharedPage(_folder() / name, _WORDS, _SINGLES, _TEXT_BYTES, create=False)
        except FileNotFoundError:
            return None
        return self._pages[name]


class Heartbeats:
    """Detects which of some nodes have beaten since the last call."""

    def __init__(self, nodes: Sequence[str]) -> None:
        self._nodes = tuple(nodes)
        self._records = NodeRecords()
        self._seen: dict[str, tuple[int, int]] = {}

    def new(self) -> list[str]:
        """Nodes with a new beat. Beats from before this object was made do not count: such a node may be dead."""
        return [name for name in self._nodes if self._has_beaten(name)]

    def _has_beaten(self, name: str) -> bool:
        state = self._records.read(name)
        if state is None or not state.beats:
            return False
        beat, before = (state.pid, state.beats), self._seen.get(name)
        self._seen[name] = beat
        return before is not None and before != beat


def names() -> list[str]:
    """The nodes that have a record, dead ones included."""
    return sorted(path.name for path in _folder().glob("*")) if _folder().exists() else []
