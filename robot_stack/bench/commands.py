"""Verbs of the command line, as an operator would type them."""

from __future__ import annotations

import subprocess
import sys

from robot_stack.bench.framework import BenchError


def robot_stack(*arguments: str, check: bool = True) -> str:
    """What ``robot-stack ...`` printed. Raises BenchError if it failed, unless told not to."""
    command = [sys.executable, "-m", "robot_stack.cli", *arguments]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    if check and done.returncode != 0:
        raise BenchError(f"robot-stack {' '.join(arguments)}: {done.stderr.strip()}")
    return done.stdout
