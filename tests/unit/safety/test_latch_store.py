"""The latch on file: round trip, and emergency stop for whatever cannot be understood."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from robot_stack.safety.latch_store import UNKNOWN_PAST, LatchStore
from robot_stack.safety.monitor import Memory


@pytest.mark.parametrize(
    "memory", [Memory(), Memory(("ESTOP_PRESSED",), True), Memory(("DRIVE_FAULT", "TILT"), False), Memory((), True)]
)
def test_round_trip(tmp_path: Path, memory: Memory) -> None:
    store = LatchStore(tmp_path / "latch.json")
    store.save(memory)
    assert store.load() == memory
    assert [path.name for path in tmp_path.iterdir()] == ["latch.json"]


def test_no_file_is_no_memory(tmp_path: Path) -> None:
    assert LatchStore(tmp_path / "latch.json").load() == Memory()


def test_an_unknown_past_is_an_emergency_with_a_passenger() -> None:
    assert Memory(("ESTOP_PRESSED",), True) == UNKNOWN_PAST


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        "\x00\x01",
        json.dumps({"latched": []}),
        json.dumps({"latched": [], "passenger": False, "more": 1}),
        json.dumps({"latched": "TILT", "passenger": False}),
        json.dumps({"latched": None, "passenger": False}),
        json.dumps({"latched": ["NO_SUCH_FAULT"], "passenger": False}),
        json.dumps({"latched": [["TILT"]], "passenger": False}),
        json.dumps({"latched": [1], "passenger": False}),
        json.dumps({"latched": [], "passenger": 0}),
        json.dumps({"latched": [], "passenger": None}),
    ],
)
def test_nonsense_is_an_unknown_past(tmp_path: Path, text: str) -> None:
    path = tmp_path / "latch.json"
    path.write_text(text)
    assert LatchStore(path).load() == UNKNOWN_PAST


def test_bytes_that_are_no_text_are_an_unknown_past(tmp_path: Path) -> None:
    path = tmp_path / "latch.json"
    path.write_bytes(b"\xff\xfe\x80")
    assert LatchStore(path).load() == UNKNOWN_PAST


def test_a_file_that_cannot_be_read_is_an_unknown_past(tmp_path: Path) -> None:
    path = tmp_path / "latch.json"
    path.mkdir()
    assert LatchStore(path).load() == UNKNOWN_PAST


def test_a_crash_while_writing_leaves_the_old_file(tmp_path: Path) -> None:
    store = LatchStore(tmp_path / "latch.json")
    store.save(Memory(("TILT",), True))
    (tmp_path / "latch.json.new").write_text('{"latched": [')
    assert store.load() == Memory(("TILT",), True)


def test_saving_where_nothing_can_be_written_raises(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        LatchStore(tmp_path / "missing" / "latch.json").save(Memory())
