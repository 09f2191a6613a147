"""A file is replaced as a whole, or keeps its content."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from robot_stack.core.atomic_file import create_file, replace_file, sync_folder


@pytest.mark.parametrize("content", ["neu: ä\n", b"\x00\xff"])
def test_content_is_replaced_and_no_draft_is_left(tmp_path: Path, content: str | bytes) -> None:
    path = tmp_path / "state.yaml"
    path.write_text("a longer text than the new one")
    replace_file(path, content, mode=0o600)
    assert path.read_bytes() == (content.encode() if isinstance(content, str) else content)
    assert path.stat().st_mode & 0o777 == 0o600
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("function", ["fsync", "replace"])
def test_failure_keeps_the_old_content_and_frees_the_space(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, function: str
) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    path = tmp_path / "state.yaml"
    path.write_text("old")
    monkeypatch.setattr(os, function, fail)
    with pytest.raises(OSError, match="No space left"):
        replace_file(path, "new")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_content_is_on_the_disk_before_the_name_and_the_name_on_return(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    order: list[str] = []
    fsync, replace = os.fsync, os.replace

    def note_sync(descriptor: int) -> None:
        order.append("sync")
        fsync(descriptor)

    def note_replace(source: Path, target: Path) -> None:
        order.append("replace")
        replace(source, target)

    monkeypatch.setattr(os, "fsync", note_sync)
    monkeypatch.setattr(os, "replace", note_replace)
    replace_file(tmp_path / "durable", "x")
    assert order == ["sync", "replace", "sync"]
    order.clear()
    replace_file(tmp_path / "fast", "x", durable=False)
    assert order == ["replace"]


def test_folder_that_is_missing_is_an_error_and_one_that_cannot_be_synced_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: int) -> None:
        raise OSError(errno.EINVAL, "Invalid argument")

    for act in (lambda: replace_file(tmp_path / "missing" / "file", "x"), lambda: sync_folder(tmp_path / "missing")):
        with pytest.raises(FileNotFoundError):
            act()
    monkeypatch.setattr(os, "fsync", refuse)
    sync_folder(tmp_path)


def test_new_file_never_replaces_another(tmp_path: Path) -> None:
    path = tmp_path / "state.yaml"
    create_file(path, "first")
    with pytest.raises(FileExistsError):
        create_file(path, "second")
    assert path.read_text() == "first"
    assert list(tmp_path.iterdir()) == [path]
