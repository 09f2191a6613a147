"""The demonstration where it runs no ride: interrupted before, with wrong names, beside a running stack."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from robot_stack.supervisor import client
from robot_stack.supervisor.control import NotRunning, ask
from tests.support.processes import ROOT, NodeProcess, Start


@pytest.fixture
def demo(start: Start, tmp_path: Path) -> Callable[..., NodeProcess]:
    """``demo("--mission", ID)`` starts it with its results below tmp_path."""

    def run(*arguments: str) -> NodeProcess:
        return start("demo", command=[sys.executable, "-m", "sim.demo", "--output", str(tmp_path), *arguments])

    return run


def test_sigterm_ends_it_even_where_sigint_is_ignored(tmp_path: Path) -> None:
    """A shell that starts it in the background ignores SIGINT."""
    script = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "from sim import demo; demo.client.refuse_second = lambda: None\n"
        "demo._ride = lambda *_: signal.raise_signal(signal.SIGTERM)\n"
        f"sys.argv = ['demo', '--output', {str(tmp_path)!r}]\n"
        "raise SystemExit(demo.main())"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "\ndemo: interrupted; the stack is stopped\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--mission", "nowhere"), "there is no mission 'nowhere'; known: "),
        (("--world", "nowhere"), "no world 'nowhere'"),
    ],
)
def test_wrong_names_are_reported(demo: Callable[..., NodeProcess], arguments: tuple[str, ...], message: str) -> None:
    process = demo(*arguments)
    assert process.wait(200.0) == 1
    assert message in process.output()
    with pytest.raises(NotRunning):
        ask("status")


def test_demo_leaves_a_running_stack_alone(
    demo: Callable[..., NodeProcess], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    profile = tmp_path / "other.yaml"
    profile.write_text(
        "description: other\nmachine: robot\nuse_sim_time: false\nspeed: null\nengine: null\nready_deadline_s: 30\n"
        "processes: []\nextra:\n  other: {module: tests.support.supervised, criticality: optional, note: other}\n"
        f"environment: {{SUPERVISED_ORDERS: {tmp_path}}}\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    client.start(client.Launch(str(profile), log_dir=tmp_path / "logs"), 30.0)
    try:
        process = demo()
        assert process.wait(100.0) == 1
        assert "already running" in process.output()
        assert ask("status")["ok"]
    finally:
        client.stop()
