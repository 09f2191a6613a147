"""Times of the middleware, which are system times, on the clock of a simulated world."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Callable

# Readings are this far apart at least, and as many are kept: a listener reads its messages every 0.1 s.
_APART_NS = 1_000_000
_KEPT = 256


class WorldTimes:
    """Converts system times of the recent past by interpolation between readings of both clocks.

    A simulated world advances unevenly, so that the result is exact at the readings only.
    system_ns, world_ns: the two clocks, in ns.
    """

    def __init__(self, system_ns: Callable[[], int], world_ns: Callable[[], int]) -> None:
        self._system_ns, self._world_ns = system_ns, world_ns
        self._system: deque[int] = deque(maxlen=_KEPT)
        self._world: deque[int] = deque(maxlen=_KEPT)

    def at(self, system_ns: int) -> int:
        """The world's time in ns at this system time; that of the first or last reading beyond them."""
        self._read()
        after = bisect_right(self._system, system_ns)
        if after == 0:
            return self._world[0]
        if after == len(self._system):
            return self._world[-1]
        begin_ns, end_ns = self._system[after - 1], self._system[after]
        world_ns, ends_ns = self._world[after - 1], self._world[after]
        return world_ns + (ends_ns - world_ns) * (system_ns - begin_ns) // (end_ns - begin_ns)

    def _read(self) -> None:
        system_ns, world_ns = self._system_ns(), self._world_ns()
        if self._system and (system_ns < self._system[-1] or world_ns < self._world[-1]):  # a clock was set back
            self._system.clear()
            self._world.clear()
        if not self._system or system_ns - self._system[-1] >= _APART_NS:
            self._system.append(system_ns)
            self._world.append(world_ns)
