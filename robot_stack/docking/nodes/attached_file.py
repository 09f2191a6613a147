"""Stores whether a wheelchair is attached, for the controller after a restart."""

from __future__ import annotations

from robot_stack.core.atomic_file import replace_file
from robot_stack.core.runtime import state_dir

_ATTACHED, _FREE = "attached\n", "free\n"


class AttachedFile:
    """``wheelchair_attached`` in the state folder."""

    def __init__(self) -> None:
        self._path = state_dir() / "wheelchair_attached"
        self._stored: bool | None = None

    def load(self) -> bool:
        """An unreadable or invalid file counts as attached. Without a file no chair was ever attached."""
        try:
            text = self._path.read_text(encoding="ascii")
        except FileNotFoundError:
            return False
        except (OSError, ValueError):
            return True
        return text != _FREE

    def save(self, attached: bool) -> str:
        """Writes to the disk if changed. Returns the error, else an empty text."""
        if attached == self._stored:
            return ""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self._path, _ATTACHED if attached else _FREE)
        except OSError as error:
            return f"{self._path} cannot be written: {error.strerror or error}"
        self._stored = attached
        return ""

    def forget(self) -> None:
        """Deletes the file: a restarted world begins without a history."""
        self._path.unlink(missing_ok=True)
