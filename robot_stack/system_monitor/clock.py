"""Monitors steps and drift of the system clock against the steady one, which affect ages, logs and stamps."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ClockState:
    """offset_s: movement of the system clock against the steady one since the start; steps: number of jumps."""

    offset_s: float
    steps: int
    last_step_s: float


class ClockWatch:
    """step_s: a larger jump between two readings is a step; smaller ones are slewing or slow readings."""

    def __init__(self, step_s: float) -> None:
        self._step_s = step_s
        self._first_s = self._last_s = math.nan
        self._steps = 0
        self._last_step_s = 0.0

    def update(self, system_s: float, steady_s: float) -> ClockState:
        """Updates with both clocks, read together."""
        difference_s = system_s - steady_s
        if math.isnan(self._first_s):
            self._first_s = self._last_s = difference_s
        jump_s = difference_s - self._last_s
        if abs(jump_s) >= self._step_s:
            self._steps += 1
            self._last_step_s = jump_s
        self._last_s = difference_s
        return ClockState(difference_s - self._first_s, self._steps, self._last_step_s)
