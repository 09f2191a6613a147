"""The clocks of a node: the system's, a simulated world's in shared memory, or ``/clock``.

A clock provides three things: the time for stamps, the time that ages and timers are measured in, and the time to
sleep until a timer is due. Timers live on the steady clock, so that setting the system clock back stops no node.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Protocol

from robot_stack.core.world_clock import WorldClock

# Limits of the time between two reads of a simulated clock that is late or stands still. In between it grows with the
# delay: else all nodes of a world that waits for one of them would use up the processor time that this one needs.
_LEAST_WAIT_S, _LONGEST_WAIT_S = 0.0005, 0.02
_WAIT_PER_OVERDUE = 0.5


class NodeClock(Protocol):
    """simulated: time is not the system's."""

    simulated: bool

    def ros_s(self) -> float:
        """For stamps."""
        ...

    def ros_ns(self) -> int:
        """The same in whole nanoseconds."""
        ...

    def timer_s(self) -> float:
        """For timers and ages; never stepped on a real machine."""
        ...

    def age_s(self, real_s: float) -> float:
        """The age, on this clock, of a value read ``real_s`` ago by the monotonic clock."""
        ...

    def real_wait_s(self, due_s: float) -> float:
        """Real seconds until ``timer_s`` reaches ``due_s`` at the earliest."""
        ...


class SystemClock:
    """Stamps from the system clock, timers from the steady one."""

    simulated = False

    def ros_s(self) -> float:
        return time.time()

    def ros_ns(self) -> int:
        return time.time_ns()

    def timer_s(self) -> float:
        return time.monotonic()

    def age_s(self, real_s: float) -> float:
        return real_s

    def real_wait_s(self, due_s: float) -> float:
        return due_s - time.monotonic()


class SharedWorldClock:
    """Reads a simulated world's time from shared memory of this machine, without messages or wake-ups."""

    simulated = True

    def __init__(self, world: WorldClock) -> None:
        self._world = world

    def ros_s(self) -> float:
        return self._world.now_s()

    def ros_ns(self) -> int:
        return self._world.now_ns()

    def timer_s(self) -> float:
        return self._world.now_s()

    def age_s(self, real_s: float) -> float:
        """A world's state is at most as old as its last step."""
        return min(real_s * self._world.speed, self._world.into_step_s())

    def real_wait_s(self, due_s: float) -> float:
        if due_s == math.inf:
            return math.inf
        speed = self._world.speed
        late_s = min(_WAIT_PER_OVERDUE * self._world.overdue_s() / speed, _LONGEST_WAIT_S)
        return max(_LEAST_WAIT_S, late_s, (due_s - self._world.now_s()) / speed)


class TopicClock:
    """``/clock`` of another simulation or of a recording. Each of its messages wakes the node."""

    simulated = True

    def __init__(self, now_s: Callable[[], float]) -> None:
        self._now_s = now_s

    def ros_s(self) -> float:
        return self._now_s()

    def ros_ns(self) -> int:
        return round(1e9 * self._now_s())

    def timer_s(self) -> float:
        return self._now_s()

    def age_s(self, real_s: float) -> float:
        return 0.0  # its ticks are coarser than that

    def real_wait_s(self, due_s: float) -> float:
        return 0.0 if due_s <= self._now_s() else math.inf
