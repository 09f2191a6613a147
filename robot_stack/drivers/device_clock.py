"""Converts a device's clock to this computer's, by the lower convex hull of the delays.

No data arrives before it is sent. Of all (device time, arrival) pairs the fastest lie on the lower convex hull of the
delays, and the hull's edge over the middle of the window gives the clocks' offset and drift, without the jitter of
lines, buffers and schedulers, which only adds delay.
"""

from __future__ import annotations

from collections import deque
from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config


class DeviceClockParams(Config):
    """window_s: of the pairs used. drift_max_ppm: of the two clocks against each other.

    jump_s: a pair this far off means that one of the clocks was set or restarted; late pairs only if they continue
    for confirm_s, because a line may stall.
    """

    window_s: Annotated[float, Field(ge=5.0, le=600.0)]
    drift_max_ppm: Annotated[float, Field(gt=0.0, le=1000.0)]
    jump_s: Annotated[float, Field(ge=0.005, le=10.0)]
    confirm_s: Annotated[float, Field(ge=0.1, le=60.0)]


_TRUSTED_SHARE = 0.2  # of the window, below which the drift is taken for none: an edge that short is all jitter


class DeviceClock:
    """Call for every message. Times in s; the device's from any origin."""

    def __init__(self, params: DeviceClockParams) -> None:
        self._params = params
        self._hull: deque[tuple[float, float]] = deque()  # device time, arrival minus device time
        self._late_since_s: float | None = None
        self._drift = 0.0
        self._newest_s: float | None = None
        self.jumps = 0

    @property
    def drift_ppm(self) -> float:
        return 1e6 * self._drift

    def update(self, device_s: float, arrival_s: float) -> float:
        """``device_s`` converted to this computer's clock; never after ``arrival_s``."""
        if self._newest_s is not None and (device_s < self._newest_s or self._jumped(device_s, arrival_s)):
            self.jumps += 1
            self.restart()
        self._newest_s = device_s
        self._add(device_s, arrival_s - device_s)
        self._fit()
        return device_s + self._delay(device_s)

    def restart(self) -> None:
        """Clears all pairs: the device was reconnected."""
        self._hull.clear()
        self._late_since_s, self._newest_s, self._drift = None, None, 0.0

    def _delay(self, device_s: float) -> float:
        """Arrival minus device time of the fastest message at ``device_s``."""
        return min(delay - self._drift * (at_s - device_s) for at_s, delay in self._hull)

    def _jumped(self, device_s: float, arrival_s: float) -> bool:
        off_s = arrival_s - device_s - self._delay(device_s)
        if off_s < -self._params.jump_s:
            return True
        if off_s < self._params.jump_s:
            self._late_since_s = None
            return False
        if self._late_since_s is None or arrival_s < self._late_since_s:
            self._late_since_s = arrival_s
        return arrival_s - self._late_since_s >= self._params.confirm_s

    def _add(self, device_s: float, delay: float) -> None:
        hull = self._hull
        while hull and hull[0][0] < device_s - self._params.window_s and len(hull) > 1:
            hull.popleft()
        while hull and hull[-1][0] == device_s:
            delay = min(delay, hull.pop()[1])
        while len(hull) >= 2 and _bends_up(hull[-2], hull[-1], (device_s, delay)):
            hull.pop()
        hull.append((device_s, delay))

    def _fit(self) -> None:
        hull, limit = self._hull, 1e-6 * self._params.drift_max_ppm
        span_s = hull[-1][0] - hull[0][0]
        if span_s < _TRUSTED_SHARE * self._params.window_s:
            return
        middle_s = hull[0][0] + 0.5 * span_s
        right = next(i for i in range(1, len(hull)) if hull[i][0] >= middle_s)
        (a_s, a), (b_s, b) = hull[right - 1], hull[right]
        self._drift = min(max((b - a) / (b_s - a_s), -limit), limit)


def _bends_up(first: tuple[float, float], second: tuple[float, float], third: tuple[float, float]) -> bool:
    """``second`` lies on or above the line from ``first`` to ``third``."""
    return (second[1] - first[1]) * (third[0] - first[0]) >= (third[1] - first[1]) * (second[0] - first[0])


class Unwrapped:
    """A device counter without its overflows, counted from the first value. ticks: its range."""

    def __init__(self, ticks: int) -> None:
        self._range = ticks
        self._last: int | None = None
        self._total = 0

    def update(self, ticks: int) -> int:
        """The count; a value less than half the range behind the last has gone back."""
        if self._last is None:
            self._total = ticks
        else:
            step = (ticks - self._last) % self._range
            self._total += step if step < self._range // 2 else step - self._range
        self._last = ticks
        return self._total
