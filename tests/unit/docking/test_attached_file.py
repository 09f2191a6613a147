"""The file that records what the robot is docked to: an unreadable file counts as an attached wheelchair."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot_stack.core.runtime import state_dir
from robot_stack.docking.nodes.attached_file import AttachedFile


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return state_dir() / "wheelchair_attached"


@pytest.mark.parametrize("attached", [True, False])
def test_round_trip(path: Path, attached: bool) -> None:
    file = AttachedFile()
    assert file.save(not attached) == ""
    assert file.save(attached) == ""
    assert AttachedFile().load() is attached
    assert [item.name for item in path.parent.iterdir()] == [path.name]
    path.unlink()
    assert file.save(attached) == ""
    assert not path.exists(), "the same is written once"


def test_station_is_kept_until_it_is_left(path: Path) -> None:
    file = AttachedFile()
    assert file.save(False, "charger") == ""
    assert (AttachedFile().load(), AttachedFile().load_station()) == (False, "charger")
    assert file.save(True, "charger") == ""
    assert (AttachedFile().load(), AttachedFile().load_station()) == (True, "charger")
    assert file.save(False) == ""
    assert (AttachedFile().load(), AttachedFile().load_station()) == (False, "")


@pytest.mark.parametrize("data", [b"station", b"station \n", b"", b"fre", b"\xff\xfe", b"attached"])
def test_invalid_attached_file_loads_as_attached(path: Path, data: bytes) -> None:
    path.parent.mkdir(parents=True)
    path.write_bytes(data)
    assert AttachedFile().load()


def test_unreadable_attached_file_loads_as_attached_and_save_reports_error(path: Path) -> None:
    path.mkdir(parents=True)
    file = AttachedFile()
    assert file.load()
    assert "wheelchair_attached cannot be written" in file.save(True)
    path.rmdir()
    assert file.save(True) == ""  # saving is retried


def test_a_new_world_has_no_past(path: Path) -> None:
    AttachedFile().forget()
    AttachedFile().save(True)
    AttachedFile().forget()
    assert not AttachedFile().load()
