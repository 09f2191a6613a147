"""``robot-stack`` in the process of the test: a new interpreter for each command would take most of a test's time."""

from __future__ import annotations

import io
import sys
from contextlib import redirect_stderr, redirect_stdout
from typing import NamedTuple
from unittest import mock

from robot_stack.cli import main


class Done(NamedTuple):
    """What a shell gets."""

    returncode: int
    stdout: str
    stderr: str


def cli(*arguments: str) -> Done:
    """Runs a command to its end. Not for one that replaces its process: run, record, simulate, up --foreground."""
    code = 0
    with (
        redirect_stdout(io.StringIO()) as stdout,
        redirect_stderr(io.StringIO()) as stderr,
        mock.patch.object(sys, "argv", ["robot-stack", *arguments]),
    ):
        try:
            main()
        except SystemExit as end:
            code = int(end.code or 0)
    return Done(code, stdout.getvalue(), stderr.getvalue())
