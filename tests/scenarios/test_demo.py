"""The demonstration: it runs a ride, reports the result, and leaves no process behind. Refusals: tests/nodes."""

from __future__ import annotations

import contextlib
import json
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest
from PIL import Image

from robot_stack.supervisor import client
from robot_stack.supervisor.control import NotRunning, ask
from tests.support.compiled import assert_set_up_compiled_everything, tell_what_is_compiled
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for

Demo = Callable[..., NodeProcess]
pytestmark = pytest.mark.timeout(1800)


@pytest.fixture
def demo(start: Callable[..., NodeProcess], tmp_path: Path) -> Iterator[Demo]:
    """``demo("--mission", ID)`` starts it with its results below tmp_path. Any remaining stack is stopped at the end:
    the supervisor is a separate process, which does not end with a killed demo.
    """

    def run(*arguments: str) -> NodeProcess:
        command = [sys.executable, "-m", "sim.demo", "--speed", "2", "--output", str(tmp_path / "results"), *arguments]
        return start("demo", command=command)

    yield run
    with contextlib.suppress(NotRunning):
        client.stop()


def stack_processes() -> list[int]:
    """The processes of the running stack, its supervisor first; empty if none runs."""
    try:
        supervisor = psutil.Process(ask("status")["pid"])
    except (NotRunning, TimeoutError, psutil.Error):
        return []
    return [supervisor.pid, *(child.pid for child in supervisor.children(recursive=True))]


def assert_gone(pids: list[int]) -> None:
    wait_for(lambda: not any(psutil.pid_exists(pid) for pid in pids), "every process of the stack to be gone")


@pytest.mark.slow
def test_short_demo_carries_the_wheelchair(demo: Demo, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the robot's own drivers, on devices simulated at their wires. On topics: tests/simulated/test_fleet.py."""
    tell_what_is_compiled(monkeypatch)
    process = demo("--short", "--devices")
    code = process.wait(1700.0)
    output = process.output()
    assert code == 0, output
    assert "START_MISSION short_transport: Short wheelchair transport, 6 waypoints" in output
    assert "with passenger" in output
    assert "reached the goal: " in output
    folder = (tmp_path / "results" / "demo-latest").resolve()
    result = json.loads((folder / "figures.json").read_text())
    assert result["state"] == "COMPLETED"
    # In simulated time, independent of the machine's load; 15 s of it are start, film and end.
    assert result["figures"]["time_s"] < 75.0
    assert result["wheelchair"]["carried_m"] > 5.0
    assert result["wheelchair"]["beside_m"] < 0.10
    assert result["figures"]["final_error_m"] < 0.10
    assert "about to start: warning" in result["stops"][0]["why"]  # departure warning of 2 s
    for name in ("map.png", "recording", "film.gif"):
        assert f"  {folder / name}" in output
    assert (folder / "course.png").stat().st_size > 1000
    assert (folder / "recording" / "metadata.yaml").is_file()  # exists only for a completed recording
    with Image.open(folder / "film.gif") as film:
        assert film.n_frames > 100
    assert (folder / "film.gif").stat().st_size < 3e6
    page = (folder / "result.html").read_text(encoding="utf-8")
    assert f"all of it on one page: {(folder / 'result.html').as_uri()}" in output
    assert 'src="film.gif"' in page
    assert all(f"<td>{name}</td>" in page for name in ("pick-up", "destination", "clear"))
    assert len(output.splitlines()) < 60
    assert_set_up_compiled_everything(folder / "logs")
    assert stack_processes() == []


def test_interrupt_stops_everything(demo: Demo) -> None:
    process = demo()
    process.wait_output("RUNNING", 200.0)
    pids = stack_processes()
    assert len(pids) > 5
    process.signal(signal.SIGINT)
    assert process.wait(200.0) == 130
    assert "interrupted; the stack is stopped" in process.output()
    assert_gone(pids)


def test_interrupt_during_the_start_stops_everything(demo: Demo) -> None:
    process = demo()
    pids = wait_for(stack_processes, "the first processes")
    process.signal(signal.SIGINT)
    assert process.wait(200.0) == 130
    assert_gone(pids)
