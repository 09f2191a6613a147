"""Shows the progress of a run on the scheduler: simulated time, speed, mission, safety."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TextIO

from robot_stack.contract.states import DockingState
from sim.stack.run import ScheduledRun

_LINE_EVERY_S = 10.0
_WIDTH = 150


class RunProgress:
    """One line that changes in place on a terminal; elsewhere a line for each change, and one every 10 s of real time.

    clock: real time in s.
    """

    def __init__(self, out: TextIO, clock: Callable[[], float] = time.monotonic) -> None:
        self._out, self._clock, self._in_place = out, clock, out.isatty()
        self._begun_s: tuple[float, float] | None = None
        self._last: tuple[object, ...] = ()
        self._last_s = -_LINE_EVERY_S
        self._open = False

    def show(self, run: ScheduledRun) -> None:
        """Called once per simulated second."""
        now_s, real_s = run.now_s, self._clock()
        if self._begun_s is None:
            self._begun_s = now_s, real_s
        line = f"{now_s:6.1f} s  {self._speed(now_s, real_s):>6}  {describe_run(run)}"
        if self._in_place:
            self._out.write(f"\r{line[:_WIDTH]:{_WIDTH}}")
            self._open = True
        elif not self._is_due(run, real_s):
            return
        else:
            self._out.write(line + "\n")
        self._out.flush()

    def end_line(self) -> None:
        """Before anything else is printed."""
        if self._open:
            self._out.write("\n")
            self._open = False

    def _speed(self, now_s: float, real_s: float) -> str:
        assert self._begun_s is not None
        begun_s, begun_real_s = self._begun_s
        return f"x{(now_s - begun_s) / (real_s - begun_real_s):.2f}" if real_s > begun_real_s else ""

    def _is_due(self, run: ScheduledRun, real_s: float) -> bool:
        mission, safety = run.mission, run.safety
        now = (
            mission and (mission.state, mission.current_waypoint),
            safety and (safety.safety_state, list(safety.active_faults)),
            run.notes.docking and run.notes.docking.state,
        )
        if now == self._last and real_s < self._last_s + _LINE_EVERY_S:
            return False
        self._last, self._last_s = now, real_s
        return True


def describe_run(run: ScheduledRun) -> str:
    """Mission, waypoint, docking, true speed and safety in one line."""
    mission, safety, docking = run.mission, run.safety, run.notes.docking
    parts = []
    if run.scenario.mission is not None and mission is not None:
        parts.append(f"{mission.state} {mission.waypoints_completed}/{mission.total_waypoints}")
        parts.append(f"to {mission.current_waypoint or '-'}")
    if docking is not None and docking.state != DockingState.IDLE:
        parts.append(docking.state)
    if run.run_log.moments:
        parts.append(f"{run.run_log.moments[-1].twist.speed():.2f} m/s")
    if safety is not None:
        parts.append(f"{safety.safety_state} {' '.join(safety.active_faults)}".strip())
    return "  ".join(parts)
