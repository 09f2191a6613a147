"""The whole stack on the deterministic scheduler: its speed, and whether the same seed gives the same run."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from robot_stack.core.wheels_env import ros_environment
from tests.benchmarks.support.framework import Aim, BenchError, Result
from tests.benchmarks.support.stack import busy_loops

AIMS = {
    "speed_full": Aim(">=", 1.5),
    "speed_light": Aim(">=", 6.0),
    "digests_equal": Aim(">=", 20),
    "digests_differ": Aim("<=", 0),
}
_BUSY = 4
_INTERRUPTED = 130


def run(
    ride: str = "demo",
    until_s: float = 0.0,
    pairs: int = 20,
    pair_ride: str = "demo:short",
    pair_until_s: float = 0.0,
    seed: int = 1,
    speed: bool = True,
) -> Result:
    """ride: SCENARIO of ``robot-stack simulate`` for the speeds. pair_ride: for the digests, with light sensors.

    until_s: 0 for whole rides. speed: False computes only digests. Run nothing else while measuring speeds.
    """
    figures: dict[str, float] = {}
    conditions: dict[str, Any] = {"seed": seed}
    if speed:
        for name, light in (("speed_full", False), ("speed_light", True)):
            found = simulate(ride, seed, until_s, light=light)
            figures[name] = found["conditions"]["speed"]
            conditions[name] = {
                "ride": found["conditions"]["command"],
                "simulated_s": found["simulated_s"],
                "mission_state": found["figures"]["mission_state"],
                "digest": found["digest"],
            }
    if pairs:
        equal, differing = _pairs(pair_ride, pair_until_s, seed, pairs)
        figures |= {"digests_equal": equal, "digests_differ": len(differing)}
        conditions["digests"] = (
            f"{pairs} pairs of {pair_ride} light, seeds {seed} to {seed + pairs - 1}, the second of each pair with "
            f"another PYTHONHASHSEED and on one core; pairs of even numbers beside {_BUSY} busy loops"
        )
        conditions["seeds_that_differ"] = differing
    return Result(figures, conditions)


def _pairs(ride: str, until_s: float, first_seed: int, count: int) -> tuple[int, list[int]]:
    """The number of equal pairs, and the seeds of the others."""
    equal, differing = 0, []
    for index, seed in enumerate(range(first_seed, first_seed + count)):
        with busy_loops(_BUSY) if index % 2 else nullcontext():
            first, second = (
                simulate(ride, seed, until_s, light=True, serial=serial, hash_seed=hash_seed)["digest"]
                for serial, hash_seed in ((False, 1), (True, 2))
            )
        if first == second:
            equal += 1
        else:
            differing.append(seed)
    return equal, differing


def simulate(
    ride: str, seed: int, until_s: float = 0.0, *, light: bool = False, serial: bool = False, hash_seed: int = 0
) -> dict[str, Any]:
    """figures.json of one run in its own process. Raises BenchError if the run fails."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "sim.stack.simulate", *_arguments(ride, seed, until_s), "--output", folder]
        command += [*(("--light",) if light else ()), *(("--serial",) if serial else ()), "--no-plots"]
        environment = {**os.environ, **ros_environment(), "PYTHONHASHSEED": str(hash_seed)}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        files = list(Path(folder).glob("*-latest/figures.json"))
        if not files or done.returncode == _INTERRUPTED:
            raise BenchError(f"{' '.join(command)} ended with {done.returncode}: {(done.stdout + done.stderr)[-2000:]}")
        found: dict[str, Any] = json.loads(files[0].read_text(encoding="utf-8"))
        return found


def _arguments(ride: str, seed: int, until_s: float) -> Iterator[str]:
    yield from (ride, "--seed", str(seed))
    if until_s > 0.0:
        yield from ("--until", str(until_s))
