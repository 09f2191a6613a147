"""``robot-stack coverage`` with files that cannot be written."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot_stack.cli import coverage
from robot_stack.cli.errors import CommandError


def test_a_file_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(CommandError, match="cannot be written: "):
        coverage._write(tmp_path / "file" / "figures.json", {})
