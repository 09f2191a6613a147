"""A demonstration is independent of the state of earlier runs, and a failure reports what to do."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from robot_stack.core.config import config_dir
from robot_stack.core.mission_library import MissionError
from robot_stack.core.runtime import environment_with_home, own_missions_dir, state_shadow_dir
from robot_stack.supervisor import client
from sim import demo


@pytest.fixture(autouse=True)
def user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's data folder."""
    monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(tmp_path / "runtime"))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "user"))
    monkeypatch.setattr("sys.argv", ["demo", "--output", str(tmp_path / "results")])
    return own_missions_dir()


def launched(monkeypatch: pytest.MonkeyPatch, error: Exception) -> list[client.Launch]:
    """Records the launches that a demo requests. Each fails with ``error``."""
    launches: list[client.Launch] = []

    def start(launch: client.Launch, *_: Any) -> Any:
        shadow = state_shadow_dir(launch.environment())
        shadow.mkdir(parents=True)
        launches.append(launch)
        raise error

    monkeypatch.setattr(client, "start", start)
    return launches


def test_state_lies_in_the_results_and_nothing_stays_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    launches = launched(monkeypatch, client.StartError("not ready: sim_world"))
    assert not [item for item in demo._settings(demo._options()) if "/" in item], "no file outside the home"
    assert demo.main() == 1
    (launch,) = launches
    folder = (tmp_path / "results" / "demo-latest").resolve()
    assert launch.home == folder
    assert launch.environment()["XDG_STATE_HOME"] == str(folder / "state")
    assert not state_shadow_dir(launch.environment()).exists()
    reported = capsys.readouterr().err
    assert "demo: not ready: sim_world" in reported
    assert "recording: none" in reported
    assert "run it again" in reported


def test_a_failure_names_its_recording(tmp_path: Path) -> None:
    (tmp_path / "recording").mkdir()
    (tmp_path / "recording" / "recording_0.mcap").touch()
    (tmp_path / "logs").mkdir()
    reported = demo._evidence(tmp_path)
    assert f"recording: {tmp_path / 'recording'}" in reported
    assert f"robot-stack film {tmp_path / 'recording'}" in reported
    assert str(tmp_path / "logs" / "latest") in reported


def test_demo_beside_running_stack_reports_error_with_advice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse() -> None:
        raise client.StartError("a stack is already running in ROS domain 7 (profile sim, process 1)")

    monkeypatch.setattr(client, "refuse_second", refuse)
    assert demo.main() == 1
    reported = capsys.readouterr().err
    assert "already running in ROS domain 7" in reported
    assert "`launch_scripts/stack down`" in reported
    assert "ROS_DOMAIN_ID=N" in reported
    assert not (tmp_path / "results").exists()


def test_a_folder_that_cannot_be_made_is_explained(tmp_path: Path) -> None:
    (tmp_path / "taken").touch()
    with pytest.raises(demo.DemoError, match="choose another with --output"):
        demo._folder(tmp_path / "taken")


def test_a_mission_of_the_user_goes_with_the_demo(user: Path, tmp_path: Path) -> None:
    user.mkdir(parents=True)
    shutil.copy(config_dir() / "missions" / "short_hop.yaml", user)
    assert demo._library("short_hop").find("short_hop").id == "short_hop", "a shipped name does not stop it"
    text = (config_dir() / "missions" / "short_hop.yaml").read_text(encoding="utf-8")
    (user / "my_round.yaml").write_text(text.replace("short_hop", "my_round"), encoding="utf-8")
    library = demo._library("my_round")
    assert library.find("my_round").id == "my_round"
    demo._bring_missions(library, tmp_path / "home")
    assert (own_missions_dir(environment_with_home(tmp_path / "home")) / "my_round.yaml").is_file()
    with pytest.raises(MissionError, match="known: "):
        demo._library("nowhere").find("nowhere")
