"""The log time of messages in the live view."""

from __future__ import annotations

import time

from robot_stack.core.world_clock import WorldClock

_CLOCK_LOOKUP_S = 1.0


class LogClock:
    """The time by which viewers sort messages."""

    def __init__(self) -> None:
        self._world: WorldClock | None = None
        self._lookup_s = 0.0

    def now_ns(self) -> int:
        if time.monotonic() >= self._lookup_s:  # a restarted stack has a new clock
            self._lookup_s = time.monotonic() + _CLOCK_LOOKUP_S
            self._world = WorldClock.find()
        return time.time_ns() if self._world is None else self._world.now_ns()
