"""Errors of verbs: one clear line and an exit code."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from robot_stack.core.errors import ConfigError

NOT_DONE = 1
WRONG_USE = 2


class CommandError(Exception):
    """Ends the command with the message and exit code ``code``."""

    def __init__(self, message: str, code: int = NOT_DONE) -> None:
        super().__init__(message)
        self.code = code


class NoAnswer(CommandError):
    """No node answered within the timeout."""


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Raises CommandError naming ``path`` if the block raises OSError."""
    try:
        yield
    except OSError as error:
        raise CommandError(f"{path} cannot be written: {error.strerror or error}") from None


def write_json(path: Path, document: object) -> None:
    """Writes a JSON file, with its folder. Raises CommandError if it cannot be written."""
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")


def exit_code(error: Exception) -> int | None:
    """The exit code of an error with a message for the user; None for any other."""
    if isinstance(error, CommandError):
        return error.code
    return WRONG_USE if isinstance(error, ConfigError) else None
