"""Runs a scenario of kind ``kernel``: a script of twists through the drive's kernels, with its events."""

from __future__ import annotations

import bisect
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.core.robot import load_robot
from robot_stack.drive.kinematics import ModuleSetPoints
from sim.parameters import load_sim_params
from sim.plant.rig import Rig, TwistController
from sim.plant.world import Setup
from sim.run.run_log import RunLog, motion_figures
from sim.run.scenario import Event, Scenario
from sim.worldfile import load_world


def run_kernel(scenario: Scenario, log: Callable[[str], None]) -> tuple[RunLog, dict[str, Any]]:
    """Notes and figures of the run. Raises ConfigError, ValueError, FaultRefused, SimulationDiverged."""
    return _KernelRun(scenario, log).run()


class _KernelRun:
    def __init__(self, scenario: Scenario, log: Callable[[str], None]) -> None:
        self._scenario, self._log = scenario, log
        self._run_log = RunLog()
        passenger = scenario.passenger_mass_kg
        setup = Setup(
            load_world(scenario.world),
            scenario.seed,
            scenario.start_pose(),
            wheelchair=True,
            attached_at_start=passenger is not None,
            passenger_mass_kg=passenger or 0.0,
        )
        self._rig = Rig(load_robot(), load_sim_params(), setup)
        self._begun_s = self._rig.sim.time_s
        self._controller = TwistController(self._rig.robot, self._requested, passenger is not None)
        self._script = sorted(scenario.twists, key=lambda item: item.at_s)
        self._times = [item.at_s for item in self._script]
        self._waiting = sorted(scenario.events, key=lambda item: item.at_s, reverse=True)

    def run(self) -> tuple[RunLog, dict[str, Any]]:
        start = self._rig.moment().pose
        self._rig.run(self._scenario.limit_s, self._controller, self._each)
        figures = motion_figures(self._run_log, goal=None)
        truth, odometry = self._rig.moment().pose.relative_to(start), self._controller.pose
        figures["odometry_error_m"] = odometry.distance_to(truth)
        alarms = [int(code) for code in self._rig.sim.world.drives.alarm_codes if code]
        figures["drive_alarms"] = ", ".join(f"0x{code:04X}" for code in sorted(set(alarms)))
        return self._run_log, figures

    def _now_s(self) -> float:
        return self._rig.sim.time_s - self._begun_s

    def _requested(self, time_s: float) -> Twist2:
        index = bisect.bisect_right(self._times, time_s - self._begun_s + 1e-9) - 1
        return self._script[index].twist() if index >= 0 else ZERO_TWIST

    def _each(self, set_points: ModuleSetPoints | None) -> None:
        now_s, moment = self._now_s(), self._rig.moment()
        while self._waiting and self._waiting[-1].at_s <= now_s + 1e-9:
            self._do(self._waiting.pop(), now_s)
        run_log = self._run_log
        run_log.moments.append(replace(moment, time_s=now_s))
        run_log.requested.append((now_s, self._controller.twist))
        if set_points is not None:
            run_log.commands.append((now_s, set_points.speeds_mps, set_points.angles_rad))
        stop = self._rig.engine.status().emergency_stop
        run_log.log_state(now_s, "EMERGENCY_STOP" if stop else "NORMAL")

    def _do(self, event: Event, now_s: float) -> None:
        done = event.describe()
        if event.fault is not None:
            done = self._rig.faults.inject(event.fault, event.target, event.value, event.duration_s)
        elif event.estop is not None:
            self._rig.emergency_stop(event.estop)
            self._controller.stopped = event.estop
        elif event.passenger is not None:
            self._controller.set_passenger(event.passenger)
        self._run_log.events.append((now_s, done))
        self._log(f"{now_s:7.2f} s  {done}")
