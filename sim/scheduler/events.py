"""Virtual time and its event queue."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from typing import Any

NEVER = 2**62
NANOSECONDS = 1_000_000_000


class EventQueue:
    """Events ordered by (time, order, sequence): time in ns order of the owner, first come first served.

    ``run`` may be called within an event: the inner run advances the same time.
    """

    def __init__(self) -> None:
        self.now_ns = 0
        self.events = 0
        self._sequence = 0
        self._heap: list[tuple[int, int, int, Callable[..., Any], tuple[Any, ...]]] = []
        self._stopped = False

    def push(self, time_ns: int, order: int, callback: Callable[..., Any], *args: Any) -> None:
        """Raises ValueError for a time that has passed."""
        if time_ns < self.now_ns:
            raise ValueError(f"an event at {time_ns} ns is {self.now_ns - time_ns} ns in the past: {callback!r}")
        self._sequence += 1
        heapq.heappush(self._heap, (time_ns, order, self._sequence, callback, args))

    def stop(self) -> None:
        """Ends every ``run`` after the present event; time is kept. The next outermost ``run`` continues."""
        self._stopped = True

    def resume(self) -> None:
        self._stopped = False

    @property
    def stopped(self) -> bool:
        return self._stopped

    def run(self, until_ns: int, condition: Callable[[], bool] | None = None) -> bool:
        """Runs the events up to ``until_ns``, that time included. Returns True if the condition ended it before.

        condition: asked before the first and after each event.
        """
        heap, pop = self._heap, heapq.heappop
        if condition is not None and condition():
            return True
        while heap and heap[0][0] <= until_ns and not self._stopped:
            time_ns, _, _, callback, args = pop(heap)
            self.now_ns = time_ns
            self.events += 1
            callback(*args)
            if condition is not None and condition():
                return True
        if not self._stopped:
            self.now_ns = max(self.now_ns, until_ns)
        return False
