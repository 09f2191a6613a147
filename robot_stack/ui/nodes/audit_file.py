"""The audit log in a file that outlives a reboot, and its newest entries."""

from __future__ import annotations

import logging
from collections import deque
from datetime import UTC, datetime
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import Any

from robot_stack.core.config import ConfigError
from robot_stack.core.runtime import state_dir
from robot_stack.ui.audit import Entry, line, read

_FILE = "touch_ui_audit.jsonl"
_BYTES_MAX = 2_000_000
_OLD_FILES = 4


class AuditFile:
    """At most five files of 2 MB. Raises ConfigError if it cannot be opened: operator actions must be recorded."""

    def __init__(self, entries: int) -> None:
        self.path = state_dir() / _FILE
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            self._newest = deque(_read(self.path, entries), entries)
            self._file = RotatingFileHandler(self.path, maxBytes=_BYTES_MAX, backupCount=_OLD_FILES, encoding="ascii")
        except OSError as error:
            raise ConfigError(f"touch_ui: audit log {self.path} cannot be written: {error.strerror}") from error

    def add(self, who: str, what: str, outcome: str) -> None:
        entry = Entry(datetime.now(UTC).isoformat(timespec="milliseconds"), who, what, outcome)
        self._newest.append(entry)
        self._file.emit(logging.makeLogRecord({"msg": line(entry)}))

    def section(self) -> dict[str, Any]:
        """Newest first."""
        return {
            "list": [
                {"at": item.at, "who": item.who, "what": item.what, "outcome": item.outcome}
                for item in reversed(self._newest)
            ]
        }

    def close(self) -> None:
        self._file.close()


def _read(path: Path, entries: int) -> list[Entry]:
    return read(path.read_text(encoding="ascii", errors="replace"), entries) if path.is_file() else []
