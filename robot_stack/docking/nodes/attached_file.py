"""Whether a wheelchair was attached, on file, so that a restarted controller knows what the latch should be holding."""

from __future__ import annotations

import os

from robot_stack.core.runtime import state_dir

_ATTACHED, _FREE = "attached\n", "free\n"


class AttachedFile:
    """``wheelchair_attached`` in the state folder."""

    def __init__(self) -> None:
        self._path = state_dir() / "wheelchair_attached"
        self._stored: bool | None = None

    def load(self) -> bool:
        """A file that cannot be read, or makes no sense, counts as attached. Without one no chair was ever attached."""
        try:
            text = self._path.read_text(encoding="ascii")
        except FileNotFoundError:
            return False
        except (OSError, ValueError):
            return True
        return text != _FREE

    def save(self, attached: bool) -> str:
        """To the disk, if it is not there yet. Returns what went wrong, else an empty text."""
        if attached == self._stored:
            return ""
        draft = self._path.with_name(f"{self._path.name}.new")
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with open(draft, "w", encoding="ascii") as file:
                file.write(_ATTACHED if attached else _FREE)
                file.flush()
                os.fsync(file.fileno())
            os.replace(draft, self._path)
        except OSError as error:
            return f"{self._path} cannot be written: {error.strerror or error}"
        self._stored = attached
        return ""

    def forget(self) -> None:
        """A world that begins anew has no past: its latch is as it is."""
        self._path.unlink(missing_ok=True)
