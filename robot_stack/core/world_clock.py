"""The time of a simulated world, in shared memory beside ``/clock``.

A ``/clock`` message costs each of a dozen processes a wake-up; at 100 Hz that is more than half a core. Here the world
writes the time, and a node reads it when needed and sleeps by its own estimate of when a timer is due.
"""

from __future__ import annotations

import time
from pathlib import Path

from robot_stack.core.runtime import runtime_dir
from robot_stack.core.shared_page import SharedPage

_TIME_NS, _STEP_NS, _SPEED_PPM, _WRITTEN_NS = range(4)
_WORDS = 4
_PACE_PPM = 0
_SINGLES = 1
_PPM = 1e6
_TEXT_BYTES = 208
_SLOW = 0.95  # of the desired speed: a slower world reports its pace
_RESTART_NS = 1_000_000_000  # a jump back of more than this is a restarted world


def slow_text(pace: float, speed: float = 1.0) -> str:
    """``simulation at 0.7x`` if a world that should run at ``speed`` times real time is slower; else empty.

    pace: simulated over real time; 0 before the world has written it.
    """
    return f"simulation at {pace:.1f}x" if 0.0 < pace < _SLOW * speed else ""


def clock_path() -> Path:
    return runtime_dir() / "world_clock"


class WorldClock:
    """The time is 0 until the world writes it for the first time."""

    def __init__(self, page: SharedPage) -> None:
        self._page = page
        self._latest_ns = 0

    @classmethod
    def make(cls) -> WorldClock:
        """The clock of this ROS domain, for the world or for the process that starts first."""
        return cls(SharedPage(clock_path(), _WORDS, _SINGLES, _TEXT_BYTES, create=True))

    @classmethod
    def find(cls) -> WorldClock | None:
        """None if no world of this domain has a clock."""
        try:
            return cls(SharedPage(clock_path(), _WORDS, _SINGLES, _TEXT_BYTES, create=False))
        except FileNotFoundError:
            return None

    @staticmethod
    def remove() -> None:
        clock_path().unlink(missing_ok=True)

    def write(self, time_s: float, step_s: float, speed: float) -> None:
        """The world has computed up to ``time_s`` and goes on in steps of ``step_s`` at ``speed`` times real time."""
        with self._page.writing() as words:
            words[_TIME_NS] = round(1e9 * time_s)
            words[_STEP_NS] = round(1e9 * step_s)
            words[_SPEED_PPM] = round(_PPM * speed)
            words[_WRITTEN_NS] = time.monotonic_ns()

    def now_s(self) -> float:
        """``now_ns`` in seconds."""
        return 1e-9 * self.now_ns()

    def now_ns(self) -> int:
        """Within a step, time advances by the steady clock, so that long steps do not make the clock coarse. It never
        passes the next step's time, and goes back only if the world restarts.
        """
        time_ns, into_step_ns, _ = self._read()
        now_ns = time_ns + into_step_ns
        if self._latest_ns - _RESTART_NS < now_ns < self._latest_ns:
            return self._latest_ns
        self._latest_ns = now_ns
        return now_ns

    def into_step_s(self) -> float:
        """How far the clock has advanced beyond the time last written by the world."""
        return 1e-9 * self._read()[1]

    def overdue_s(self) -> float:
        """How far a world at full speed would be beyond the present step: the time for which the clock has stood."""
        return 1e-9 * self._read()[2]

    def _read(self) -> tuple[int, int, int]:
        """The written time, the time into its step, and the time beyond the step."""
        time_ns, step_ns, speed_ppm, written_ns = self._page.read()
        since_ns = max(0, int((time.monotonic_ns() - written_ns) * speed_ppm / _PPM))
        return time_ns, min(since_ns, step_ns), max(0, since_ns - step_ns)

    def write_pace(self, pace: float) -> None:
        self._page.set_single(_PACE_PPM, round(_PPM * pace))

    @property
    def pace(self) -> float:
        """Simulated over real time in the last second; 0 before the world has written it."""
        return self._page.single(_PACE_PPM) / _PPM

    def write_waiting_for(self, text: str) -> None:
        self._page.text = text

    @property
    def waiting_for(self) -> str:
        """The nodes that the world waits for, and why; empty if it does not wait, or not for long."""
        return self._page.text

    @property
    def speed(self) -> float:
        """1.0 unless the world has written another."""
        return self._page.read()[_SPEED_PPM] / _PPM or 1.0
