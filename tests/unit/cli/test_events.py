"""``robot-stack events`` on events of a real black box, and the same events for the touch screen."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import Result
from rosbags.highlevel import AnyReader
from typer.testing import CliRunner

from robot_stack.cli.app import app
from robot_stack.cli.errors import CommandError
from robot_stack.core.kept_events import black_box_dir, events_dir
from robot_stack.ui.nodes.site import kept_events
from tests.unit.recording.test_black_box_files import EPOCH_S, Rig


@pytest.fixture
def ids(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[str, str]:
    """(complete, under way)"""
    monkeypatch.setattr("robot_stack.recording.background.disk_use", lambda folder: 0.5)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    rig = Rig(black_box_dir())
    rig.run(5.0)
    rig.box.trigger(("CONTACT",))
    rig.run(1.0)
    rig.box.trigger(("TILT",))
    rig.run(20.0)
    rig.box.trigger(("DRIVE_FAULT",))
    rig.run(1.0)
    newest, oldest = (item["id"] for item in kept_events(events_dir())["list"])
    return oldest, newest


def call(*arguments: str, answer: str = "") -> Result:
    return CliRunner().invoke(app, ["events", *arguments], input=answer)


def test_list_and_json(ids: tuple[str, str]) -> None:
    shown = call("list")
    assert shown.exit_code == 0
    assert "CONTACT, TILT" in shown.output
    newest, oldest = json.loads(call("list", "--json").output)
    assert (oldest["id"], newest["id"]) == ids
    assert (oldest["state"], newest["state"]) == ("complete", "open")
    assert oldest["reasons"] == ["CONTACT", "TILT"]
    assert Path(oldest["path"]) == events_dir() / ids[0]
    touch_screen = kept_events(events_dir())
    assert touch_screen["folder"] == str(events_dir())
    newest, oldest = touch_screen["list"]
    found = (newest["state"], oldest["state"], oldest["reasons"], oldest["at"])
    assert found == ("open", "complete", ["CONTACT", "TILT"], round(1e3 * (EPOCH_S + 5.0)))


def test_an_empty_list_names_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    shown = call("list")
    assert shown.exit_code == 0
    assert "no events in" in shown.output
    assert "no events in" in str(call("show", "latest").exception)
    assert json.loads(call("list", "--json").output) == kept_events(events_dir())["list"] == []


def test_show_and_path(ids: tuple[str, str]) -> None:
    text = call("show", ids[0]).output
    assert "CONTACT (ROS time 1750000005.000 s)" in text
    assert "map: yard, SHA-256 cd" in text
    assert "safety_monitor: process 7, silent for 0.1 s, ready" in text
    about = json.loads(call("show", "latest", "--json").output)
    assert about["id"] == ids[1]
    assert about["triggers"][0]["reasons"] == ["DRIVE_FAULT"]
    assert call("path", ids[0]).output.strip() == str(events_dir() / ids[0])
    refused = call("show", "nothing").exception
    assert isinstance(refused, CommandError)
    assert refused.code == 2


def test_an_exported_event_is_a_recording(ids: tuple[str, str], tmp_path: Path) -> None:
    assert call("export", ids[0], str(tmp_path / "stick")).exit_code == 0
    with AnyReader([tmp_path / "stick" / ids[0]]) as reader:
        assert reader.message_count > 30
    again = call("export", ids[0], str(tmp_path / "stick"))
    assert isinstance(again.exception, CommandError)
    assert "exists already" in str(again.exception)


def test_delete_asks_first(ids: tuple[str, str]) -> None:
    assert call("delete", ids[0], answer="n\n").exit_code == 1
    assert (events_dir() / ids[0]).exists()
    assert call("delete", ids[0], "--yes").exit_code == 0
    assert not (events_dir() / ids[0]).exists()


@pytest.mark.parametrize("verb", [("export", "stick"), ("delete", "--yes")])
def test_the_event_under_way_stays(ids: tuple[str, str], tmp_path: Path, verb: tuple[str, str]) -> None:
    refused = call(verb[0], ids[1], verb[1])
    assert "still being recorded" in str(refused.exception)
    assert (events_dir() / ids[1]).exists()
