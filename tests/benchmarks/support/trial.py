"""Runs what a benchmark measures apart from the running stack: a program of its own, in a ROS domain of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from robot_stack.core.runtime import ros_domain_id
from tests.benchmarks.support.framework import ROOT, BenchError

_LAST_DOMAIN = 101  # the highest domain with free ports on every system


def run_trial(module: str, arguments: Callable[[Path], list[str]], limit_s: float) -> dict[str, float]:
    """The figures that the module prints as JSON in its last line.

    arguments: of the program, given a folder that is deleted afterwards. Raises BenchError.
    """
    with tempfile.TemporaryDirectory() as folder:
        runtime = Path(folder) / "runtime"
        own = {"ROS_DOMAIN_ID": str((ros_domain_id() + 1) % _LAST_DOMAIN), "ROBOT_STACK_RUNTIME_DIR": str(runtime)}
        command = [sys.executable, "-m", module, *arguments(Path(folder))]
        try:
            done = subprocess.run(
                command,
                cwd=ROOT,
                env={**os.environ, **own},
                capture_output=True,
                text=True,
                check=False,
                timeout=limit_s,
            )
        except subprocess.TimeoutExpired as error:
            raise BenchError(f"{module} did not end within {limit_s:.0f} s") from error
    if done.returncode:
        raise BenchError(f"the trial ended with code {done.returncode}: {done.stderr.strip()[-500:]}")
    sys.stderr.write(done.stderr)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found
