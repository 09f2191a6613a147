"""How exactly, how surely and how fast the robot docks, by the ground truth of the physics."""

from __future__ import annotations

import math
import multiprocessing
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from custom_msgs.action import Dock
from robot_stack.contract import actions
from robot_stack.core.camera import camera_file, load_intrinsics
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import IDENTITY, Pose2
from robot_stack.docking.results import DockCode
from sim.camera.conditions import Conditions
from sim.settings import pose_settings
from tests.benchmarks.support.bad_pictures import BAD
from tests.benchmarks.support.few_nodes import DRIVE, WITHOUT_MAP, FewNodes
from tests.benchmarks.support.framework import Aim, BenchError, Result

AIMS = {
    "err_mm_p95": Aim("<", 1.5),
    "yaw_deg_p95": Aim("<", 0.2),
    "success_pct": Aim(">", 99.0),
    "time_s_median": Aim("<", 30.0),
    "contact_force_n_max": Aim("<", 30.0),
}
NODES = (*DRIVE, "navigation_controller", "docking_controller", "aruco_detector", "camera_driver")
_DOCK = "chair_1"
_LIMIT_S = 200.0
_BAD_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class Trial:
    """Drawn values of one run. start: base_link against the staging pose; chair: the dock against its nominal pose."""

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
    """One run. Errors: base_link relative to the dock pose when the controller reports DOCKED, before the latch."""

    trial: Trial
    success: bool
    code: str
    reason: str
    error_mm: float
    yaw_deg: float
    time_s: float
    tries: int
    contact_n: float


def run(runs: int = 200, seed: int = 1, workers: int = 0, untaught_every: int = 5) -> Result:
    """Returns (figures, conditions). Wheels, steering zeros, camera and mounting are drawn anew for each run.

    workers: processes; 0: one per core. untaught_every: each n-th run has no teaching from an earlier closed latch.
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
    return Result(
        figures,
        {
            "runs": runs,
            "start": "+-0.5 m, +-20 deg around staging",
            "chair": "+-5 deg, passenger 0-120 kg, ground inclined up to 3 deg in any direction",
            "camera": "focal length 0.1 %, principal point 0.3 px, mounting 1 mm and 0.1 deg off, drawn for each run",
            "taught": f"by one earlier closed latch, but each {untaught_every}th run not: those are untaught_*",
            "weather": f"{_BAD_SHARE:.0%} of the runs under one of {', '.join(BAD)}; else light of 30-100 %",
            "success by weather": _by_weather(outcomes),
            "failures": [{**asdict(o.trial), "code": o.code, "reason": o.reason} for o in outcomes if not o.success],
            "time": "simulated, from the staging pose to the closed latch and what it taught",
        },
    )


def _counted(outcomes: Iterable[Outcome], runs: int) -> list[Outcome]:
    """Collects all outcomes and shows the progress on a terminal, because 200 runs take ten minutes."""
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


def dock(trial: Trial, learnt: Path | None = None) -> Outcome:
    """Drives one trial. learnt: the file with the corrections taught by dockings; without it a taught robot docks once
    before the trial, on even ground and in clear light.
    """
    if learnt is None:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "corrections.yaml"
            if trial.taught:
                dock(Trial(trial.seed, IDENTITY, IDENTITY, 0.0, 0.0, 0.0, "clear", taught=False), file)
            return dock(trial, file)
    with FewNodes(trial.seed, NODES, [*settings_of(trial), f"docking_controller.corrections_file={learnt}"]) as stack:
        return Docking(stack, trial).run()


class Docking:
    """The docking of a trial. error: along m, across m, yaw rad of base_link from the dock pose, as the latch began
    to close for the first time. contact_n: the largest force between robot and wheelchair before the latch closed.
    """

    def __init__(self, stack: FewNodes, trial: Trial) -> None:
        self.stack, self._trial = stack, trial
        self._dock_pose = load_docks().docks[_DOCK].dock_pose.pose()
        self.error = (math.nan,) * 3
        self._contact_n = 0.0
        self._result: Any = None
        light = light_of(trial)
        stack.node("camera_driver").conditions = lambda _, time_s: light(time_s)
        assert stack.world is not None
        stack.world.after_block.append(self._watch)

    def run(self) -> Outcome:
        scheduler = self.stack.scheduler
        begun_s = scheduler.now_s
        client = self.stack.operator.port.action_client(actions.DOCK)
        goal = client.send_goal(Dock.Goal(dock_id=_DOCK), lambda _: goal.ask_result(self._on_result), lambda _: None)
        scheduler.run_for(_LIMIT_S, lambda: self._result is not None)
        along, across, yaw = self.error
        result = self._result
        return Outcome(
            trial=self._trial,
            success=result is not None and result.success,
            code="none in time" if result is None else DockCode(result.error_code).name,
            reason="" if result is None else result.reason,
            error_mm=1e3 * math.hypot(along, across),
            yaw_deg=math.degrees(abs(yaw)),
            time_s=scheduler.now_s - begun_s,
            tries=0 if result is None else result.tries,
            contact_n=self._contact_n,
        )

    def _watch(self) -> None:
        world = self.stack.physics
        if not world.attached:
            self._contact_n = max(self._contact_n, world.contact_force_n())
        if math.isnan(self.error[0]) and world.drives.latch_outputs == (True, False):
            self.error = world.dock_error(self._dock_pose)

    def _on_result(self, _: object, result: Any) -> None:
        self._result = result


def settings_of(trial: Trial) -> list[str]:
    """The settings of a trial: the localization starts at the staging pose, not at the true start."""
    staging = load_docks().docks[_DOCK].staging.pose()
    return [
        "sim_world.world=flat",
        "camera_driver.world=flat",
        f"sim_world.passenger_mass_kg={trial.passenger_kg}",
        f"sim_world.slope_rad={trial.slope_rad}",
        f"sim_world.slope_direction_rad={trial.slope_direction_rad}",
        *WITHOUT_MAP,
        *pose_settings("sim_world.start", staging.compose(trial.start)),
        *pose_settings("sim_world.wheelchair", dock_nominal().compose(trial.chair)),
        *pose_settings("ndt_localization.start", staging),
    ]


def dock_nominal() -> Pose2:
    """The dock frame in map at the nominal pose of ``config/docks.yaml``."""
    definition = load_docks().docks[_DOCK]
    ahead = Pose2(1.5, 0.0, 0.0)
    return definition.staging.pose().compose(ahead).compose(definition.dock_pose.pose().inverse())


def light_of(trial: Trial) -> Callable[[float], Conditions]:
    """The light of a trial, constant for all its images except the effects that vary with the camera motion."""
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
