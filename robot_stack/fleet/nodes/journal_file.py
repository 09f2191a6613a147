"""The agent's journal: one file, replaced atomically."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from robot_stack.core.atomic_file import replace_file
from robot_stack.core.runtime import state_dir
from robot_stack.fleet.record import Record


class JournalFile:
    """path: empty for the robot's state folder."""

    def __init__(self, path: str) -> None:
        self._path = Path(path) if path else state_dir() / "fleet_agent.json"
        self._saved: Record | None = None

    def load(self) -> tuple[Record, str]:
        """The record, and why there is none although there should be. A damaged file is kept beside the new one."""
        try:
            record = Record.model_validate_json(self._path.read_bytes())
        except FileNotFoundError:
            return Record(), ""
        except (ValidationError, OSError) as error:
            return Record(), self._move_aside(" ".join(str(error).split()))
        self._saved = record
        return record, ""

    def save(self, record: Record) -> str:
        """Returns why the record is not on the disk, empty if it is. Does nothing for the record that is there."""
        if record == self._saved:
            return ""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            replace_file(self._path, record.model_dump_json(), mode=0o600)
        except OSError as error:
            return f"{self._path}: {error.strerror or error}"
        self._saved = record
        return ""

    def _move_aside(self, why: str) -> str:
        damaged = self._path.with_name(f"{self._path.name}.damaged")
        try:
            self._path.replace(damaged)
        except OSError as error:
            return f"the journal {self._path} cannot be read ({why}) nor moved: {error.strerror or error}"
        return f"the journal was damaged ({why}) and is now {damaged}"
