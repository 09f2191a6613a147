"""Keeps simulated time in step with a clock, on absolute deadlines.

A late step is caught up with the next ones, at twice the pace at most: the nodes on this time must be able to follow. A
lag beyond ``catch_up_s`` is given up and counted, because a loop that runs after a lag it cannot make good falls ever
further behind.
"""

from __future__ import annotations

from dataclasses import dataclass

_CATCH_UP_PACE = 2.0


@dataclass(frozen=True, slots=True)
class PaceReport:
    """Statistics since the last report. ``speed`` is simulated over real time, ``dropped_s`` real time given up."""

    speed: float
    steps: int
    overruns: int
    drops: int
    dropped_s: float
    worst_lag_s: float


class Pacer:
    """Computes the wait before every step. ``period_s`` is simulated, all other times are the caller's clock."""

    def __init__(self, period_s: float, speed: float, catch_up_s: float, now_s: float) -> None:
        if period_s <= 0.0 or speed <= 0.0 or catch_up_s <= 0.0:
            raise ValueError("period_s, speed and catch_up_s must be above zero")
        self._period_s = period_s
        self._real_period_s = period_s / speed
        self._catch_up_s = catch_up_s
        self._deadline_s = self._begun_s = now_s
        self.total_overruns = 0
        self.total_dropped_s = 0.0
        self._since_s = now_s
        self._steps = 0
        self._overruns = 0
        self._drops = 0
        self._dropped_s = 0.0
        self._worst_lag_s = 0.0

    def start(self, now_s: float) -> None:
        """The first step is due now: whatever was before has cost nothing."""
        self._deadline_s = self._since_s = now_s
        self._begun_s = now_s - self._real_period_s

    def wait_s(self, now_s: float) -> float:
        """Seconds to wait before the next step; 0 for a step that is due. Counts the step."""
        wait_s = self._wait_s(now_s)
        self._begun_s = now_s + wait_s
        return wait_s

    def _wait_s(self, now_s: float) -> float:
        lag_s = now_s - self._deadline_s
        self._steps += 1
        if lag_s <= 0.0:
            self._deadline_s += self._real_period_s
            return -lag_s
        self._worst_lag_s = max(self._worst_lag_s, lag_s)
        if lag_s > self._real_period_s:
            self._overruns += 1
            self.total_overruns += 1
        if lag_s > self._catch_up_s:
            self._drops += 1
            self._dropped_s += lag_s
            self.total_dropped_s += lag_s
            self._deadline_s = now_s
        self._deadline_s += self._real_period_s
        return max(0.0, self._begun_s + self._real_period_s / _CATCH_UP_PACE - now_s)

    def report(self, now_s: float) -> PaceReport:
        """Since the last report, or since the start."""
        elapsed_s = now_s - self._since_s
        speed = self._steps * self._period_s / elapsed_s if elapsed_s > 0.0 else 0.0
        result = PaceReport(speed, self._steps, self._overruns, self._drops, self._dropped_s, self._worst_lag_s)
        self._since_s = now_s
        self._steps = self._overruns = self._drops = 0
        self._dropped_s = self._worst_lag_s = 0.0
        return result
