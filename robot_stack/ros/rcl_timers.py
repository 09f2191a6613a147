"""Timers of nodes outside this stack: rcl's own."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

from rclpy.exceptions import InvalidHandle
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

RCLError = _rclpy.RCLError


class RclTimers:
    """Like ``robot_stack.middleware.timers.Schedule``, on the timers of rclpy nodes."""

    def __init__(self, timers: list[Any]) -> None:
        self._timers = timers

    def wait_s(self) -> float:
        return min((_wait_s(timer) for timer in self._timers), default=math.inf)

    def ready(self) -> bool:
        """True if a timer is due."""
        return self.wait_s() == 0.0

    def due(self) -> Iterator[Callable[[], Any]]:
        for timer in self._timers:
            try:
                if not timer.handle.is_timer_ready():
                    continue
                timer.handle.call_timer()
            except (InvalidHandle, RCLError):  # destroyed, by an earlier callback or another thread
                continue
            yield timer.callback


# A timer on a clock that stands still reports "not yet" and "now" at once.
_LEAST_WAIT_S = 0.001


def _wait_s(timer: Any) -> float:
    try:
        if timer.handle.is_timer_canceled():
            return math.inf
        if timer.handle.is_timer_ready():
            return 0.0
        return max(_LEAST_WAIT_S, 1e-9 * float(timer.handle.time_until_next_call()))
    except (InvalidHandle, RCLError):
        return math.inf
