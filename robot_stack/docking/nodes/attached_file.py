"""Stores what the robot is docked to, for the controller after a restart."""

from __future__ import annotations

from robot_stack.core.atomic_file import replace_file
from robot_stack.core.runtime import state_dir

_ATTACHED, _FREE = "attached\n", "free\n"
_STATION = "station "  # and its id


class AttachedFile:
    """``wheelchair_attached`` in the state folder."""

    def __init__(self) -> None:
        self._path = state_dir() / "wheelchair_attached"
        self._stored = ""

    def load(self) -> bool:
        """Whether a wheelchair is attached. An unreadable or invalid file counts as attached, none as not."""
        return self._read() != _FREE and not (self._read().startswith(_STATION) and self.load_station())

    def load_station(self) -> str:
        """Id of the station or charger at which the robot is docked, else empty."""
        text = self._read().removeprefix(_ATTACHED)
        return text[len(_STATION) : -1] if text.startswith(_STATION) and text.endswith("\n") else ""

    def _read(self) -> str:
        try:
            return self._path.read_text(encoding="utf-8")
        except FileNotFoundError:
            return _FREE
        except (OSError, ValueError):
            return _ATTACHED

    def save(self, attached: bool, station: str = "") -> str:
        """Writes to the disk if changed. Returns the error, else an empty text.

        station: as ``load_station``.
        """
        text = (_ATTACHED if attached else "") + (f"{_STATION}{station}\n" if station else "") or _FREE
        if text == self._stored:
            return ""
        problem = self._write(text)
        if problem:
            return f"{self._path} cannot be written: {problem}"
        self._stored = text
        return ""

    def _write(self, text: str) -> str:
        """Returns the error, else an empty text."""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self._path, text)
        except OSError as error:
            return error.strerror or str(error)
        return ""

    def forget(self) -> None:
        """Deletes the file: a restarted world begins without a history."""
        self._path.unlink(missing_ok=True)
