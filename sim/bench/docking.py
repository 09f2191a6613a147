"""How exactly, how surely and how fast the robot docks, by the ground truth of the physics."""

from __future__ import annotations

import math
import multiprocessing
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass

import numpy as np

from robot_stack.bench.framework import Aim, BenchError
from robot_stack.core.camera import camera_file, load_intrinsics
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import Pose2
from robot_stack.docking.states import State
from sim.bench.bad_pictures import BAD
from sim.bench.docking_stack import DockingStack
from sim.camera.conditions import Conditions
from sim.plant.world import Setup
from sim.worldfile import load_world

NAME = "docking"
AIMS = {
    "err_mm_p95": Aim("<", 1.5),
    "yaw_deg_p95": Aim("<", 0.2),
    "success_pct": Aim(">", 99.0),
    "time_s_median": Aim("<", 30.0),
    "contact_force_n_max": Aim("<", 30.0),
}
_DOCK = "chair_1"
_LIMIT_S = 200.0
_BAD_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class Trial:
    """What is drawn for one run. start: base_link beside the staging pose; chair: the dock beside its nominal pose."""

    seed: int
    start: Pose2
    chair: Pose2
    slope_rad: float
    slope_direction_rad: float
    passenger_kg: float
    weather: str
    taught: bool


@dataclass(frozen=True, slots=True)
class Outcome:
    """One run. Errors: base_link beside the dock pose when the controller said DOCKED, before the latch drew it in."""

    trial: Trial
    success: bool
    code: str
    reason: str
    error_mm: float
    yaw_deg: float
    time_s: float
    tries: int
    contact_n: float


def run(
    runs: int = 200, seed: int = 1, workers: int = 0, untaught_every: int = 5
) -> tuple[dict[str, float], dict[str, object]]:
    """(figures, conditions). Every robot is another one: wheels, steering zeros, camera and mounting are drawn anew.

    workers: processes; 0: one for each core. untaught_every: each so manieth robot has never been at a closed latch.
    """
    if runs < 1 or untaught_every < 2:
        raise BenchError(f"runs must be at least 1 and untaught_every at least 2, are {runs} and {untaught_every}")
    trials = [draw(seed + k, taught=k % untaught_every != 0) for k in range(runs)]
    with multiprocessing.get_context("spawn").Pool(workers or os.cpu_count()) as pool:
        outcomes = _counted(pool.imap_unordered(dock, trials), runs)
    figures = {**_figures([o for o in outcomes if o.trial.taught]), **_all(outcomes)}
    untaught = [o for o in outcomes if not o.trial.taught and math.isfinite(o.error_mm)]
    if untaught:
        figures["untaught_err_mm_p95"] = float(np.percentile([o.error_mm for o in untaught], 95))
        figures["untaught_yaw_deg_p95"] = float(np.percentile([o.yaw_deg for o in untaught], 95))
    return figures, {
        "runs": runs,
        "start": "+-0.5 m, +-20 deg around staging",
        "chair": "+-5 deg, passenger 0-120 kg, ground inclined up to 3 deg in any direction",
        "camera": "focal length 0.1 %, principal point 0.3 px, mounting 1 mm and 0.1 deg off, drawn for each run",
        "taught": f"by one earlier closed latch, but each {untaught_every}th run not: those are untaught_*",
        "weather": f"{_BAD_SHARE:.0%} of the runs under one of {', '.join(BAD)}; else light of 30-100 %",
        "success by weather": _by_weather(outcomes),
        "failures": [{**asdict(o.trial), "code": o.code, "reason": o.reason} for o in outcomes if not o.success],
        "time": "simulated, from the staging pose to the closed latch and what it taught",
    }


def _counted(outcomes: Iterable[Outcome], runs: int) -> list[Outcome]:
    """All outcomes; a terminal shows how many there are, because 200 runs take ten minutes."""
    done: list[Outcome] = []
    for outcome in outcomes:
        done.append(outcome)
        if sys.stderr.isatty():
            print(f"\r{len(done)} of {runs} runs", end="\n" if len(done) == runs else "", file=sys.stderr, flush=True)
    return done


def draw(seed: int, *, taught: bool) -> Trial:
    """The trial of a seed."""
    random = np.random.default_rng([seed, 7])
    weather = str(random.choice(list(BAD))) if random.random() < _BAD_SHARE else "clear"
    x_m, y_m = random.uniform(-0.5, 0.5, 2).tolist()
    return Trial(
        seed=seed,
        start=Pose2(x_m, y_m, math.radians(random.uniform(-20.0, 20.0))),
        chair=Pose2(0.0, 0.0, math.radians(random.uniform(-5.0, 5.0))),
        slope_rad=math.radians(random.uniform(0.0, 3.0)),
        slope_direction_rad=random.uniform(-math.pi, math.pi),
        passenger_kg=random.uniform(0.0, 120.0),
        weather=weather,
        taught=taught,
    )


def dock(trial: Trial) -> Outcome:
    """Drives one trial."""
    stack = stack_of(trial)
    if trial.taught:
        stack.teach()
    result = stack.run_docking(_LIMIT_S)
    at_dock = next((s for s in stack.docking if s.output.state is State.DOCKED), None)
    along, across, yaw = (math.nan,) * 3 if at_dock is None else at_dock.error
    return Outcome(
        trial=trial,
        success=result is not None and result.success,
        code="none in time" if result is None else result.code.name,
        reason="" if result is None else result.reason,
        error_mm=1e3 * math.hypot(along, across),
        yaw_deg=math.degrees(abs(yaw)),
        time_s=stack.time_s,
        tries=0 if result is None else result.tries,
        contact_n=stack.contact_max_n,
    )


def stack_of(trial: Trial) -> DockingStack:
    """The stack of a trial: its localization believes that the robot stands at the staging pose."""
    definition = load_docks().docks[_DOCK]
    staging = definition.staging.pose()
    chair = dock_nominal().compose(trial.chair)
    setup = Setup(
        load_world("flat"),
        trial.seed,
        staging.compose(trial.start),
        wheelchair=True,
        wheelchair_pose=chair,
        passenger_mass_kg=trial.passenger_kg,
        slope_rad=trial.slope_rad,
        slope_direction_rad=trial.slope_direction_rad,
    )
    return DockingStack(setup, _DOCK, light_of(trial), located_by=lambda _: staging)


def dock_nominal() -> Pose2:
    """The dock frame in map when everything is where ``config/docks.yaml`` says."""
    definition = load_docks().docks[_DOCK]
    ahead = Pose2(1.5, 0.0, 0.0)
    return definition.staging.pose().compose(ahead).compose(definition.dock_pose.pose().inverse())


def light_of(trial: Trial) -> Callable[[float], Conditions]:
    """The light of a trial: the same for all its pictures, but for what moves with the camera by itself."""
    random = np.random.default_rng([trial.seed, 11])
    if trial.weather in BAD:
        conditions = BAD[trial.weather](random, load_intrinsics(camera_file("front_camera")))
    else:
        gradient = (random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5))
        conditions = Conditions(illumination=random.uniform(0.3, 1.0), gradient_per_m=gradient)
    return lambda _: conditions


def _figures(outcomes: list[Outcome]) -> dict[str, float]:
    docked = [o for o in outcomes if math.isfinite(o.error_mm)]
    if not docked:
        return {}
    errors = [o.error_mm for o in docked]
    return {
        "err_mm_p50": float(np.median(errors)),
        "err_mm_p95": float(np.percentile(errors, 95)),
        "err_mm_max": max(errors),
        "yaw_deg_p95": float(np.percentile([o.yaw_deg for o in docked], 95)),
        "yaw_deg_max": max(o.yaw_deg for o in docked),
    }


def _all(outcomes: list[Outcome]) -> dict[str, float]:
    times = [o.time_s for o in outcomes if o.success]
    return {
        "success_pct": 100.0 * sum(o.success for o in outcomes) / len(outcomes),
        "first_try_pct": 100.0 * sum(o.success and o.tries == 1 for o in outcomes) / len(outcomes),
        "time_s_median": float(np.median(times)) if times else math.nan,
        "time_s_p95": float(np.percentile(times, 95)) if times else math.nan,
        "contact_force_n_max": max(o.contact_n for o in outcomes),
    }


def _by_weather(outcomes: list[Outcome]) -> dict[str, str]:
    total, good = Counter(o.trial.weather for o in outcomes), Counter(o.trial.weather for o in outcomes if o.success)
    return {name: f"{good[name]} of {count}" for name, count in sorted(total.items())}
