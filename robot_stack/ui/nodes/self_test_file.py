"""The results of self tests on the disk: a log of all, and the last with the last that passed."""

from __future__ import annotations

import os
from pathlib import Path

from robot_stack.core.atomic_file import replace_file
from robot_stack.core.runtime import state_dir
from robot_stack.ui.self_test_record import Memory, Record, after, parse_memory

_LOG, _LAST = "touch_ui_self_tests.jsonl", "touch_ui_self_test.json"


class SelfTestFile:
    """memory: also holds a result that could not be stored; ``stored`` is False then."""

    def __init__(self) -> None:
        self._log, self._last = state_dir() / _LOG, state_dir() / _LAST
        self.memory = _read(self._last)
        self.stored = True

    def add(self, record: Record) -> None:
        """Writes the record to the disk before it returns."""
        self.memory = after(self.memory, record)
        try:
            self._last.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            replace_file(self._last, self.memory.model_dump_json() + "\n")
            _append(self._log, record.model_dump_json() + "\n")
            self.stored = True
        except OSError:
            self.stored = False


def _append(path: Path, line: str) -> None:
    """Appends a whole line or nothing. Raises OSError."""
    with open(path, "ab", buffering=0) as file:
        size = file.tell()
        data = line.encode()
        try:
            if file.write(data) != len(data):
                raise OSError(f"{path} could not be written completely")
            os.fsync(file.fileno())
        except OSError:
            file.truncate(size)
            raise


def _read(path: Path) -> Memory:
    """Without a readable file no test counts as passed."""
    try:
        return parse_memory(path.read_text(encoding="utf-8", errors="replace"))
    except OSError:
        return Memory()
