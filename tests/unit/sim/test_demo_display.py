"""The output of a demonstration during a ride: little on a pipe, a progress bar and steps on a terminal."""

from __future__ import annotations

import io
from types import SimpleNamespace
from typing import Any

import pytest

from sim import demo
from sim.run.demo_display import Display, describe, doing


def observer(waypoint: str = "gate", completed: int = 0, docking: str = "IDLE", **safety: Any) -> Any:
    """Returns a stand-in for ``sim.nodes.mission_observer.Rider``."""
    return SimpleNamespace(
        mission=SimpleNamespace(
            state="RUNNING",
            current_waypoint=waypoint,
            waypoints_completed=completed,
            total_waypoints=3,
            progress=completed / 3,
        ),
        safety=SimpleNamespace(**{"safety_state": "NORMAL", "active_faults": []} | safety),
        docking=SimpleNamespace(state=docking),
        ride=SimpleNamespace(samples=[SimpleNamespace(speed_mps=0.8)]),
        moved_m=4.2,
        pace=1.0,
        waiting_for="",
        now_s=lambda: 12.0,
    )


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_pipe_gets_a_line_for_each_change_only() -> None:
    out = io.StringIO()
    display = Display(out)
    for _ in range(50):
        display.show(observer())
    for _ in range(50):
        display.show(observer("bench", 1))
    for _ in range(50):
        display.show(observer("bench", 1, "SERVOING"))
    display.end()
    lines = out.getvalue().splitlines()
    assert len(lines) == 3
    assert "RUNNING  0/3 to gate" in lines[0]
    assert "1/3 to bench" in lines[1]
    assert lines[2].endswith("NORMAL  SERVOING")


def test_a_terminal_gets_a_bar_and_each_step_once() -> None:
    out = Terminal()
    display = Display(out)
    for waypoint, completed in (("gate", 0), ("gate", 0), ("bench", 1), ("bench", 1), ("home", 2), ("", 3)):
        display.show(observer(waypoint, completed))
    display.end()
    text = out.getvalue()
    for step in ("gate", "bench", "home"):
        assert text.count(f"done {step}") + text.count(f"done\x1b[0m {step}") == 1


def test_emergency_stop_line_contains_release_commands() -> None:
    line = describe(observer(safety_state="EMERGENCY_STOP", active_faults=["ESTOP_PRESSED"]))
    assert "EMERGENCY_STOP (ESTOP_PRESSED)" in line
    assert line.endswith("`robot-stack reset`, then `robot-stack mission resume`")
    slow = observer()
    slow.pace = 0.5
    assert "simulation at 0.5x" in describe(slow)
    assert "simulation" not in describe(observer())
    states = {"IDLE": "", "DOCKED": "with passenger", "SEARCH": "SEARCH"}
    assert {state: doing(observer(docking=state)) for state in states} == states


def test_short_option_sets_mission_and_start_and_is_overridden_by_options(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["demo", "--short", "--start-error-m", "0.5"])
    options = demo._options()
    assert (options.mission, options.start_error_m, options.start_error_deg) == ("short_transport", 0.5, 0.0)
    assert options.start is not None
    monkeypatch.setattr("sys.argv", ["demo"])
    options = demo._options()
    assert (options.mission, options.start, options.start_error_m) == ("site_transport", None, 1.0)
