"""The supervisor's ROS side, in a thread of its own, from the moment ROS is imported."""

from __future__ import annotations

import queue
import threading
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robot_stack.supervisor.node import SupervisorNode


@dataclass(frozen=True, slots=True)
class Beat:
    """A heartbeat as it was received: steady seconds, process name and id, and what it said."""

    received_s: float
    name: str
    pid: int
    ready: bool
    waiting_for: str


@dataclass(frozen=True, slots=True)
class Safety:
    """What the safety monitor said last, ``age_s`` ago; ``received`` counts its messages."""

    state: str
    emergency: bool
    faults: tuple[str, ...]
    age_s: float
    received: int


class Ears:
    """``node`` is None until it is up. ``error`` tells why nothing is heard; None while it is."""

    def __init__(self) -> None:
        self.node: SupervisorNode | None = None
        self.error: str | None = None
        self._beats: queue.SimpleQueue[Beat] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ears", daemon=True)
        self._thread.start()

    def heard(self) -> Iterator[Beat]:
        """The heartbeats received since the last call."""
        while True:
            try:
                yield self._beats.get_nowait()
            except queue.Empty:
                return

    def close(self, timeout_s: float = 2.0) -> None:
        self.node = None
        self._stop.set()
        self._thread.join(timeout_s)

    def _made(self, node: SupervisorNode) -> None:
        self.node = node

    def _run(self) -> None:
        try:
            # Imported here, while the forkserver imports the same: neither waits for the other.
            from robot_stack.supervisor.node import listen

            listen(self._beats.put, self._made, self._stop.is_set)
        except Exception as error:
            traceback.print_exc()
            self.node = None
            self.error = f"heartbeats are not heard: {error}"
