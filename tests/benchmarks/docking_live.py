"""The same dockings on the whole stack in real time and on the deterministic scheduler: do they agree?"""

from __future__ import annotations

import statistics
import tempfile
from dataclasses import replace
from pathlib import Path

from robot_stack.core.docks import load_docks
from sim.settings import WORLDLY, pose_settings, world_settings
from tests.benchmarks.docking import Trial, dock, dock_nominal, draw
from tests.benchmarks.support.framework import Aim, Result
from tests.benchmarks.support.stack import running_stack

AIMS = {"live_success_pct": Aim(">=", 100.0), "live_err_mm_max": Aim("<", 4.0)}
_DOCK = "chair_1"
_LIMIT_S = 150.0


def run(runs: int = 10, seed: int = 1) -> Result:
    """(figures, conditions) of ``runs`` trials of the benchmark docking: even ground, clear light, never taught."""
    from sim.nodes.docking_trial import LiveOutcome, dock_live

    trials = [replace(draw(seed + k, taught=False), slope_rad=0.0, weather="clear") for k in range(runs)]
    live: list[LiveOutcome] = []
    for trial in trials:
        with tempfile.TemporaryDirectory() as folder, running_stack("sim", _settings(trial, Path(folder))):
            live.append(dock_live(_DOCK, load_docks().docks[_DOCK].dock_pose.pose(), _LIMIT_S))
    lockstep = [dock(trial) for trial in trials]
    pairs = list(zip(live, lockstep, strict=True))
    figures = {
        "live_success_pct": 100.0 * sum(item.success for item in live) / runs,
        "lockstep_success_pct": 100.0 * sum(item.success for item in lockstep) / runs,
        "live_err_mm_mean": statistics.fmean(item.error_mm for item in live),
        "lockstep_err_mm_mean": statistics.fmean(item.error_mm for item in lockstep),
        "live_err_mm_max": max(item.error_mm for item in live),
        "lockstep_err_mm_max": max(item.error_mm for item in lockstep),
        "live_yaw_deg_max": max(item.yaw_deg for item in live),
        "lockstep_yaw_deg_max": max(item.yaw_deg for item in lockstep),
        "live_time_s_median": statistics.median(item.time_s for item in live),
        "lockstep_time_s_median": statistics.median(item.time_s for item in lockstep),
    }
    return Result(
        figures,
        {
            "runs": runs,
            "each run": [
                f"{a.error_mm:.2f} mm {a.time_s:.1f} s live, {b.error_mm:.2f} mm {b.time_s:.1f} s" for a, b in pairs
            ],
            "robots": "the same seeds: wheels, cameras and mountings are the same in both",
            "light": "clear; even ground; no closed latch has taught anything",
        },
    )


def _settings(trial: Trial, folder: Path) -> list[str]:
    staging = load_docks().docks[_DOCK].staging.pose()
    places = {
        "sim_world.start": staging.compose(trial.start),
        "sim_world.wheelchair": dock_nominal().compose(trial.chair),
        "ndt_localization.start": staging,
    }
    return [
        *world_settings("flat"),
        *(f"{node}.seed={trial.seed}" for node in WORLDLY),
        f"sim_world.passenger_mass_kg={trial.passenger_kg}",
        f"mission_manager.journal_file={folder / 'mission.db'}",
        f"docking_controller.corrections_file={folder / 'corrections.yaml'}",
        *(line for name, pose in places.items() for line in pose_settings(name, pose)),
    ]
