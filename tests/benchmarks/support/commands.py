"""Verbs of the command line, as an operator would type them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence

from tests.benchmarks.support.framework import BenchError


def robot_stack(
    *arguments: str, check: bool = True, before: Sequence[str] = (), environment: Mapping[str, str] | None = None
) -> str:
    """The output of ``robot-stack ...``. With ``check``, raises BenchError if it failed.

    before: a command that runs it. environment: variables added to this process's.
    """
    command = [*before, sys.executable, "-m", "robot_stack.cli", *arguments]
    own = {**os.environ, **(environment or {})}
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False, env=own)
    if check and done.returncode != 0:
        raise BenchError(f"robot-stack {' '.join(arguments)}: {done.stderr.strip()}")
    return done.stdout
