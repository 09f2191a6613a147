"""Progress display of a demonstration's ride: a bar and the mission's steps."""

from __future__ import annotations

import time
from typing import Any, TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from robot_stack.contract.model import SafetyState
from robot_stack.contract.states import DockingState
from robot_stack.core.world_clock import slow_text

MOVING_MPS = 0.05
# Without a terminal: a line for each change, and one at intervals without changes.
_SHOW_EVERY_S = 30.0


class Display:
    """On a terminal a bar that moves and a line for each step that is done; elsewhere a line for each change."""

    def __init__(self, out: TextIO) -> None:
        self._shown: _Bar | _Lines = _Bar(out) if out.isatty() else _Lines(out)

    def show(self, observer: Any) -> None:
        self._shown.show(observer)

    def end(self) -> None:
        """Restores the terminal."""
        self._shown.end()


class _Bar:
    def __init__(self, out: TextIO) -> None:
        columns = (TextColumn("{task.fields[steps]}"), BarColumn(None), TimeElapsedColumn())
        self._bar = Progress(*columns, console=Console(file=out), transient=True)
        self._task = self._bar.add_task("", total=1.0, steps="")
        self._step: str | None = None
        self._bar.start()

    def show(self, observer: Any) -> None:
        mission = observer.mission
        if self._step is not None and mission.current_waypoint != self._step:
            self._bar.console.print(f"[green]done[/] {self._step}  [dim]{observer.now_s():.0f} s[/]", highlight=False)
        self._step = mission.current_waypoint
        steps = f"{mission.waypoints_completed}/{mission.total_waypoints} {describe_step(observer)}"
        self._bar.update(self._task, completed=mission.progress, steps=steps)

    def end(self) -> None:
        self._bar.stop()


class _Lines:
    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._shown_s = -_SHOW_EVERY_S
        self._shown: Any = None

    def show(self, observer: Any) -> None:
        mission, safety = observer.mission, observer.safety
        stopped, waiting = safety.safety_state == SafetyState.EMERGENCY_STOP.name, bool(observer.waiting_for)
        now = (mission.state, mission.current_waypoint, doing(observer), stopped, waiting)
        if now == self._shown and time.monotonic() - self._shown_s < _SHOW_EVERY_S:
            return
        self._shown, self._shown_s = now, time.monotonic()
        self._out.write(describe(observer) + "\n")
        self._out.flush()

    def end(self) -> None:
        pass


def doing(observer: Any) -> str:
    """Activity of docking and wheelchair; empty without either."""
    docking = observer.docking.state if observer.docking is not None else DockingState.IDLE
    shown: dict[str, str] = {DockingState.IDLE: "", DockingState.DOCKED: "with passenger"}
    return shown.get(docking, docking)


def describe_step(observer: Any) -> str:
    """The present activity, for a short line."""
    safety, speed_mps = observer.safety, observer.ride.samples[-1].speed_mps
    parts = [f"to {observer.mission.current_waypoint or '-'}", doing(observer), f"{speed_mps:.1f} m/s"]
    if safety.safety_state != SafetyState.NORMAL.name:
        parts.append(f"{safety.safety_state}: {', '.join(safety.active_faults)}")
    return "  ".join(filter(None, [*parts, _world(observer), _advice(observer)]))


def describe(observer: Any) -> str:
    """One line: time, waypoint, distance, speed, safety."""
    mission, safety, last = observer.mission, observer.safety, observer.ride.samples[-1]
    state = safety.safety_state + (f" ({', '.join(safety.active_faults)})" if safety.active_faults else "")
    way = f"{mission.waypoints_completed}/{mission.total_waypoints} to {mission.current_waypoint or '-':<12}"
    motion = f"{observer.moved_m:6.1f} m  {last.speed_mps:4.2f} m/s"
    texts = [f"{observer.now_s():5.0f} s", f"{mission.state:<8} {way} {motion}", state]
    return "  ".join([*texts, *filter(None, (doing(observer), _world(observer), _advice(observer)))])


def _world(observer: Any) -> str:
    """Cause of a delay of the simulated world; empty if it keeps its pace."""
    return f"simulation waits for {observer.waiting_for}" if observer.waiting_for else slow_text(observer.pace)


def _advice(observer: Any) -> str:
    stopped = observer.safety.safety_state == SafetyState.EMERGENCY_STOP.name
    return "`robot-stack reset`, then `robot-stack mission resume`" if stopped else ""
