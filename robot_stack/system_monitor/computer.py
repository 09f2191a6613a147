"""The computer's load and memory from the kernel's counters. NaN = unknown, never 0."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CpuTimes:
    """Seconds of all processors together since the computer's start. busy_s: without idle and I/O wait."""

    busy_s: float
    total_s: float


class CpuUsage:
    """The processors' use over a sliding window, % of all of them."""

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self._samples: deque[tuple[float, CpuTimes]] = deque()

    def update(self, times: CpuTimes | None, now_s: float) -> float:
        """Adds a reading, or None if it is missing, and returns the use, NaN until the window is full.

        Counters or times that run backwards restart the window.
        """
        if times is None or (self._samples and not self._follows(times, now_s)):
            self._samples.clear()
        if times is None:
            return math.nan
        self._samples.append((now_s, times))
        # One sample before the window is kept as its start.
        while len(self._samples) > 1 and now_s - self._samples[1][0] >= self._window_s - 1e-6:
            self._samples.popleft()
        since_s, first = self._samples[0]
        total_s = times.total_s - first.total_s
        if now_s - since_s < self._window_s - 1e-6 or total_s <= 0.0:
            return math.nan
        return min(100.0, 100.0 * (times.busy_s - first.busy_s) / total_s)

    def _follows(self, times: CpuTimes, now_s: float) -> bool:
        at_s, last = self._samples[-1]
        return now_s > at_s and times.busy_s >= last.busy_s and times.total_s >= last.total_s


def hottest(zones: Mapping[str, float]) -> tuple[str, float]:
    """Name and temperature of the hottest zone, degrees Celsius; ("", NaN) without a valid zone."""
    known = {name: celsius for name, celsius in zones.items() if math.isfinite(celsius)}
    if not known:
        return "", math.nan
    name = max(known, key=lambda zone: known[zone])
    return name, known[name]


def pressure_avg10(text: str) -> float:
    """``avg10`` of the line ``some`` of a /proc/pressure file, %: share of 10 s in which a task was stalled."""
    for line in text.splitlines():
        kind, *fields = line.split()
        if kind == "some":
            for field in fields:
                name, _, value = field.partition("=")
                if name == "avg10":
                    return _number(value)
    return math.nan


def celsius_of(text: str) -> float:
    """A thermal zone's ``temp``, in thousandths of a degree; NaN for invalid text."""
    return _number(text.strip()) / 1000.0


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


@dataclass(frozen=True, slots=True)
class ProcessFigures:
    """Figures of one process. cpu_percent: of one core since the last reading, NaN at the first. Memory in MiB."""

    name: str
    cpu_percent: float
    rss_mb: float
    pss_mb: float = math.nan


def describe_process(figures: ProcessFigures) -> str:
    """One line for users; unknown values are marked."""
    parts = (("cpu", figures.cpu_percent, "%"), ("rss", figures.rss_mb, "MB"), ("pss", figures.pss_mb, "MB"))
    return ", ".join(f"{name} {describe(value, unit)}" for name, value, unit in parts)


def describe(value: float, unit: str) -> str:
    return "unknown" if math.isnan(value) else f"{value:.1f} {unit}"


def together(figures: Sequence[ProcessFigures]) -> ProcessFigures:
    """The sum; NaN if one value is unknown."""
    return ProcessFigures(
        "all",
        math.fsum(item.cpu_percent for item in figures),
        math.fsum(item.rss_mb for item in figures),
        math.fsum(item.pss_mb for item in figures),
    )
