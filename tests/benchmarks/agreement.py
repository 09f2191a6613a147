"""The short demo on real processes and on the deterministic scheduler: do the rides agree?"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from robot_stack.contract.states import MissionState
from robot_stack.core.mission_library import mission_library
from sim.demo import evaluate
from sim.settings import SHORT_MISSION
from sim.stack.choice import choose_scenario
from sim.stack.run import ScheduledRun
from tests.benchmarks.support.framework import ROOT, Aim, BenchError, Result

AIMS = {"outside_spread": Aim("<=", 0)}
_COMPARED = ("time_s", "tracking_rms_m", "docked_mm")
_ALSO_SHOWN = ("distance_m", "final_error_m", "estimate_rms_m", "docked_deg", "beside_m")
Ride = dict[str, float]


def run(runs: int = 5, simulated: int = 5, results: str = "") -> Result:
    """``runs`` live demos and ``simulated`` runs, both of the seeds from 1 on.

    results: folder of earlier demos (`launch_scripts/demo --short --output FOLDER`), used instead of new ones.
    outside_spread: number of compared figures whose simulated median lies outside what the live runs span.
    """
    if results:
        live = [_of_folder(path) for path in sorted(Path(results).glob("demo-2*/figures.json"))]
    else:
        live = [_drive(seed) for seed in range(1, runs + 1)]
    if len(live) < 2:
        raise BenchError(f"{results or 'runs'}: two live rides or more are needed, found {len(live)}")
    scheduled = [_simulate(seed) for seed in range(1, simulated + 1)]
    figures: dict[str, float] = {"outside_spread": sum(outside(name, live, scheduled) for name in _COMPARED)}
    for name in _COMPARED + _ALSO_SHOWN:
        values = [ride[name] for ride in live]
        figures |= {
            f"live_{name}_min": min(values),
            f"live_{name}_max": max(values),
            f"simulated_{name}_median": statistics.median(ride[name] for ride in scheduled),
        }
    conditions = {
        "mission": SHORT_MISSION,
        "live": live,
        "simulated": scheduled,
        "seeds": f"simulated 1 to {simulated}; live {f'of the demos in {results}' if results else f'1 to {runs}'}",
    }
    return Result(figures, conditions)


def outside(name: str, live: Sequence[Ride], scheduled: Sequence[Ride]) -> bool:
    """True if the median of the scheduled rides lies outside what the live ones span."""
    values = [ride[name] for ride in live]
    return not min(values) <= statistics.median(ride[name] for ride in scheduled) <= max(values)


def _drive(seed: int) -> Ride:
    """One demo on real processes. Raises BenchError if it does not arrive."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "sim.demo", "--short", "--seed", str(seed), "--output", folder]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        if done.returncode:
            raise BenchError(f"{' '.join(command)} ended with {done.returncode}: {(done.stdout + done.stderr)[-2000:]}")
        return _of_folder(Path(folder) / "demo-latest" / "figures.json")


def _of_folder(path: Path) -> Ride:
    content = json.loads(path.read_text(encoding="utf-8"))
    if content["mission"] != SHORT_MISSION or content["state"] != MissionState.COMPLETED:
        raise BenchError(f"{path}: not a completed ride of {SHORT_MISSION}: {content['mission']}, {content['state']}")
    ride: Ride = content["figures"] | content["wheelchair"]
    return ride


def _simulate(seed: int) -> Ride:
    scenario, _ = choose_scenario("demo:short", seed)
    with ScheduledRun(scenario, seed) as scheduled:
        found = scheduled.run()
    if found.figures["mission_state"] != MissionState.COMPLETED:
        raise BenchError(f"simulate demo:short --seed {seed}: {found.figures['mission_state']}")
    figures, carried = evaluate(mission_library().find(SHORT_MISSION), found.ride)
    assert carried is not None, "the mission transports a wheelchair"
    return asdict(figures) | asdict(carried)
