"""Loops on absolute deadlines: which deadline is next, and a sleep that ends on it.

A sleep ends late by the system's wake-up latency: tens of microseconds, more on a virtual machine. A loop that needs
less jitter busy-waits for the last part. The length of that part is estimated from the loop's own wake-ups, within
limits. Its cost has a hard budget, so that it stays small on a machine where busy-waiting does not help.
"""

from __future__ import annotations

import ctypes
import sys
import time
from collections.abc import Callable
from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config

_PR_SET_TIMERSLACK = 29
_SLACK_NS = 1


def sharpen_sleep() -> bool:
    """Makes sleeps of the calling thread end on time. By default, Linux lets them end up to 50 us later, to wake less
    often, except for threads of a real-time priority.

    Returns False where the system has no such setting.
    """
    if not sys.platform.startswith("linux"):
        return False
    return bool(ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, ctypes.c_ulong(_SLACK_NS), 0, 0, 0) == 0)


class SpinLimits(Config):
    """Cost limits and target of busy-waiting before deadlines.

    longest_s: at most this long before one deadline. share: at most this share of a core. tolerance_s: acceptable
    lateness of a loop. on_time: the share of deadlines to be kept within the tolerance.
    """

    longest_s: Annotated[float, Field(gt=0.0, le=0.001)]
    share: Annotated[float, Field(gt=0.0, le=0.5)]
    tolerance_s: Annotated[float, Field(ge=0.0, le=0.001)]
    on_time: Annotated[float, Field(gt=0.5, lt=1.0)]


class SpinMargin:
    """How long before its deadline a sleep should end; estimated, and kept within a budget.

    Stochastic approximation of a quantile (Robbins and Monro, 1951): a wake-up later than the margin raises it, an
    earlier one lowers it; the steps balance where ``on_time`` of the wake-ups are covered. A wake-up later than the
    longest margin (a busy or paused machine) carries no information about the margin and is ignored.

    The budget grows with time, up to ``_SAVED_NS`` of run time, and shrinks by the time spent busy-waiting. The margin
    is never longer than the remaining budget: the mean over any longer time stays below ``share``.
    """

    _STEP_NS = 2000.0
    _SAVED_NS = 100_000_000

    def __init__(self, limits: SpinLimits) -> None:
        self._longest_ns = 1e9 * limits.longest_s
        self._tolerance_ns = 1e9 * limits.tolerance_s
        self._share = limits.share
        self._raise_ns = self._STEP_NS * limits.on_time
        self._lower_ns = self._STEP_NS * (1.0 - limits.on_time)
        self._margin_ns = 0.0
        self._budget_ns = 0.0
        self._most_ns = limits.share * self._SAVED_NS
        self._before_ns: int | None = None

    def take(self, now_ns: int) -> int:
        """The margin for the next deadline, ns, at ``now_ns`` of a clock that never goes back."""
        if self._before_ns is not None:
            self._budget_ns = min(self._most_ns, self._budget_ns + self._share * (now_ns - self._before_ns))
        self._before_ns = now_ns
        return int(min(self._margin_ns, self._budget_ns))

    def spend(self, awake_ns: int) -> None:
        """Subtracts time spent busy-waiting from the budget."""
        self._budget_ns -= awake_ns

    def learn(self, late_ns: int) -> None:
        """Updates the margin with the lateness of a sleep."""
        needed_ns = late_ns - self._tolerance_ns
        if needed_ns > self._longest_ns:
            return
        step_ns = self._raise_ns if needed_ns > self._margin_ns else -self._lower_ns
        self._margin_ns = min(self._longest_ns, max(0.0, self._margin_ns + step_ns))


class Sleeper:
    """Sleeps until absolute times of the monotonic clock, ns; never ends early. Belongs to one thread.

    spin: limits of the busy-waiting before a deadline; None sleeps all the time.
    """

    def __init__(
        self,
        spin: SpinLimits | None = None,
        now_ns: Callable[[], int] | None = None,
        sleep_s: Callable[[float], object] | None = None,
    ) -> None:
        self._margin = SpinMargin(spin) if spin is not None else None
        self._now_ns = now_ns or time.monotonic_ns
        self._sleep_s = sleep_s or time.sleep

    def until(self, due_ns: int) -> int:
        """Sleeps until ``due_ns``. Returns the lateness, ns."""
        margin, now_ns = self._margin, self._now_ns()
        if margin is not None:
            now_ns = self._sleep_short(due_ns, now_ns, margin)
        elif now_ns < due_ns:
            self._sleep_s((due_ns - now_ns) * 1e-9)
            now_ns = self._now_ns()
        while now_ns < due_ns:
            now_ns = self._now_ns()
        return now_ns - due_ns

    def _sleep_short(self, due_ns: int, now_ns: int, margin: SpinMargin) -> int:
        """Sleeps until the margin before ``due_ns`` begins. Returns the time then."""
        end_ns = due_ns - margin.take(now_ns)
        if now_ns < end_ns:
            self._sleep_s((end_ns - now_ns) * 1e-9)
            now_ns = self._now_ns()
            margin.learn(now_ns - end_ns)
        if now_ns < due_ns:
            margin.spend(due_ns - now_ns)
        return now_ns


class Pacer:
    """Deadlines one period apart, on a grid that does not shift when a deadline is missed.

    If a deadline is missed by whole periods, these are skipped and counted, never made up for in a burst. Belongs to
    one thread.

    period_ns: may be changed between two deadlines. due_ns: the last deadline. late_ns: how long after it the wait
    ended. missed: total number of skipped periods.
    """

    def __init__(self, period_ns: int, sleeper: Sleeper, now_ns: Callable[[], int] | None = None) -> None:
        if period_ns <= 0:
            raise ValueError(f"period_ns must be above zero, is {period_ns}")
        self.period_ns = period_ns
        self.due_ns = (now_ns or time.monotonic_ns)()
        self.late_ns = 0
        self.missed = 0
        self._sleeper = sleeper
        self._kept_ns = self.due_ns

    def wait(self) -> None:
        """Waits until the next deadline."""
        self.due_ns = self._kept_ns + self.period_ns
        self.late_ns = self._sleeper.until(self.due_ns)
        missed = self.late_ns // self.period_ns
        self.missed += missed
        self._kept_ns = self.due_ns + missed * self.period_ns
