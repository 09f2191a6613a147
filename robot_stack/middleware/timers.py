"""The timers of a node."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from typing import Any

from robot_stack.middleware.clocks import NodeClock


class NodeTimer:
    """Calls its callback at whole periods from the start of its schedule, so that timers of one node coincide.

    A missed call is skipped.
    """

    def __init__(self, schedule: Schedule, period_s: float, callback: Callable[[], Any]) -> None:
        self.period_s = period_s
        self.callback = callback
        self._schedule = schedule
        self.due_s = schedule.next_whole(period_s)

    def cancel(self) -> None:
        self.due_s = math.inf

    def reset(self) -> None:
        """Restarts the period: the next call is one period from now."""
        self.due_s = self._schedule.now_s() + self.period_s

    def is_canceled(self) -> bool:
        return self.due_s == math.inf

    def destroy(self) -> None:
        self._schedule.remove(self)


class Schedule:
    """The timers of a node on one clock. Timers may be added and removed by any thread.

    held: checked when a timer is due; while it returns True, no timer is called.
    """

    def __init__(self, clock: NodeClock, held: Callable[[], bool] | None = None) -> None:
        self._clock = clock
        self._held = held
        self._start_s = clock.timer_s()
        self._timers: list[NodeTimer] = []
        self._turn = threading.Lock()

    def now_s(self) -> float:
        return self._clock.timer_s()

    def next_whole(self, period_s: float) -> float:
        """The next time that is a whole number of periods after the start."""
        return self._start_s + period_s * (math.floor((self.now_s() - self._start_s) / period_s) + 1.0)

    def add(self, period_s: float, callback: Callable[[], Any]) -> NodeTimer:
        """Raises ValueError for a period that is not positive and finite."""
        if not 0.0 < period_s < math.inf:
            raise ValueError(f"a timer's period must be positive and finite, is {period_s}")
        timer = NodeTimer(self, period_s, callback)
        with self._turn:
            self._timers = [*self._timers, timer]
        return timer

    def remove(self, timer: NodeTimer) -> None:
        timer.cancel()
        with self._turn:
            self._timers = [item for item in self._timers if item is not timer]

    def next_due_s(self) -> float:
        """On the schedule's clock; infinite without a timer."""
        return min((timer.due_s for timer in self._timers), default=math.inf)

    def wait_s(self) -> float:
        """Real time to sleep until the next timer may be due."""
        return self._clock.real_wait_s(self.next_due_s())

    def ready(self) -> bool:
        """True if the next timer is due. A simulated clock may be behind a wait that has ended."""
        return self.now_s() >= self.next_due_s()

    def due(self) -> Iterator[Callable[[], Any]]:
        """The callbacks that are due, each once."""
        now_s = self.now_s()
        if now_s < self._start_s:  # time went back (a restarted simulation)
            self._start_s = now_s
            for timer in self._timers:
                if not timer.is_canceled():
                    timer.due_s = now_s + timer.period_s
        if self._held is not None and now_s >= self.next_due_s() and self._held():
            return
        for timer in self._timers:
            if now_s >= timer.due_s:
                timer.due_s = max(timer.due_s + timer.period_s, self.next_whole(timer.period_s))
                yield timer.callback
