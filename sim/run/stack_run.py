"""Runs a scenario of kind ``stack``: the whole stack by the supervisor, at the speed the scenario names."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from robot_stack.core.geometry import ZERO_TWIST, Pose2
from robot_stack.core.robot import load_robot
from robot_stack.supervisor import client
from robot_stack.supervisor.control import NotRunning
from sim.nodes.scenario_runner import ScenarioNode
from sim.run.run_log import RunLog, motion_figures
from sim.run.scenario import Event, Scenario
from sim.settings import pose_settings, world_settings

_READY_S = 60.0
_HEARD_S = 20.0
_NORMAL_S = 20.0
_SILENCE_S = 10.0
_MISSION_OVER = ("COMPLETED", "FAILED", "ABORTED")
_TELEOP_PERIOD_S = 0.05
# A goal counts as reached when the robot stands this near.
_AT_GOAL_M, _AT_GOAL_RAD, _STANDING_MPS = 0.05, math.radians(2.0), 0.005


class RunFailed(RuntimeError):
    """The run could not be carried out. The message says why."""


def run_stack(scenario: Scenario, folder: Path, log: Callable[[str], None]) -> tuple[RunLog, dict[str, Any]]:
    """Notes and figures. Starts a stack of its own and stops it. Raises RunFailed, ConfigError."""
    launch = client.Launch(
        "sim",
        settings=_settings(scenario),
        only=scenario.only,
        speed=scenario.speed,
        log_dir=folder / "logs",
        home=folder,  # this run neither meets nor leaves a latched stop, an unfinished mission or learnt corrections
    )
    try:
        status = client.start(launch, _READY_S)
        log(f"{len(status['processes'])} processes ready after {status['ready_after_s']:.1f} s")
        pids = {item["name"]: item["pid"] for item in status["processes"]}
        with ScenarioNode(load_robot().wheel_radius_m) as node:
            return _StackRun(scenario, node, pids, log).run()
    except (client.StartError, TimeoutError, ValueError) as error:
        raise RunFailed(str(error)) from error
    finally:
        with contextlib.suppress(NotRunning):
            client.stop()


def _settings(scenario: Scenario) -> list[str]:
    start = scenario.start_pose()
    passenger = scenario.passenger_mass_kg
    return [
        *world_settings(scenario.world),
        f"sim_world.seed={scenario.seed}",
        *pose_settings("sim_world.start", start),
        f"sim_world.attached_at_start={'false' if passenger is None else 'true'}",
        *([] if passenger is None else [f"sim_world.passenger_mass_kg={passenger}"]),
        *pose_settings("ndt_localization.start", start),
        *scenario.settings,
    ]


class _StackRun:
    def __init__(
        self, scenario: Scenario, node: ScenarioNode, pids: dict[str, int], log: Callable[[str], None]
    ) -> None:
        self._scenario, self._node, self._pids, self._log = scenario, node, pids, log
        self._waiting = sorted(scenario.events, key=lambda item: item.at_s, reverse=True)
        self._script = sorted(scenario.twists, key=lambda item: item.at_s)
        self._goals = [goal.pose() for goal in scenario.goals]
        self._goal: Pose2 | None = None
        self._next_teleop_s = 0.0
        self._heard_at_s = time.monotonic()

    def run(self) -> tuple[RunLog, dict[str, Any]]:
        node, scenario = self._node, self._scenario
        self._wait(lambda: node.alive, _HEARD_S, "the stack is silent: world, safety or mission does not speak")
        self._wait(self._may_drive, _NORMAL_S, "the stack does not become fit to drive")
        if scenario.passenger_mass_kg is not None:
            node.passenger(True)
        node.begin()
        self._wait(lambda: node.moment is not None, _HEARD_S, "no ground truth")
        if scenario.mission is not None:
            node.start_mission(scenario.mission)
        while node.now_s < scenario.limit_s and not self._over():
            self._spin()
            self._act(node.now_s)
        return node.run_log, self._figures()

    def _may_drive(self) -> bool:
        """What a start on a busy machine has latched is released as an operator would, once it is over."""
        safety = self._node.safety
        if safety is None:
            return False
        if safety.safety_state == safety.EMERGENCY_STOP:
            self._node.emergency_stop(False)
            self._log(self._node.reset())
        return bool(safety.safety_state == safety.NORMAL)

    def _act(self, now_s: float) -> None:
        while self._waiting and self._waiting[-1].at_s <= now_s:
            self._do(self._waiting.pop())
        if self._goals and self._arrived():
            self._goal = self._goals.pop(0)
            self._node.goal(self._goal)
            self._log(f"{now_s:7.2f} s  goal {self._goal.x:.2f}, {self._goal.y:.2f}")
        if self._script and now_s >= self._next_teleop_s:
            begun = [item for item in self._script if item.at_s <= now_s]
            self._node.teleop(begun[-1].twist() if begun else ZERO_TWIST)
            self._next_teleop_s = now_s + _TELEOP_PERIOD_S

    def _do(self, event: Event) -> None:
        node, done = self._node, event.describe()
        if event.fault is not None:
            done = node.inject(event.fault, event.target, event.value, event.duration_s)
        elif event.estop is not None:
            node.emergency_stop(event.estop)
        elif event.reset is not None:
            done = node.reset()
        elif event.goal_again is not None:
            if self._goal is not None:
                node.goal(self._goal)
        elif event.passenger is not None:
            node.passenger(event.passenger)
        elif event.kill is not None:
            os.kill(self._pid(event.kill), signal.SIGKILL)
        node.run_log.events.append((node.now_s, done))
        self._log(f"{node.now_s:7.2f} s  {done}")

    def _pid(self, process: str) -> int:
        if process not in self._pids:
            raise ValueError(f"kill: no process {process!r} in this stack; there are {', '.join(sorted(self._pids))}")
        return self._pids[process]

    def _arrived(self) -> bool:
        """At the present goal, standing; true before the first."""
        moment, goal = self._node.moment, self._goal
        if goal is None:
            return True
        if moment is None or moment.twist.speed() > _STANDING_MPS:
            return False
        error = moment.pose.relative_to(goal)
        return math.hypot(error.x, error.y) < _AT_GOAL_M and abs(error.yaw) < _AT_GOAL_RAD

    def _over(self) -> bool:
        mission = self._node.mission
        if self._waiting:
            return False
        if self._scenario.mission is not None:
            return mission is not None and mission.state in _MISSION_OVER and self._node.now_s > 1.0
        return bool(self._scenario.goals) and not self._goals and self._arrived()

    def _figures(self) -> dict[str, Any]:
        goal = self._scenario.goals[-1].pose() if self._scenario.goals else None
        figures = motion_figures(self._node.run_log, goal)
        mission, safety = self._node.mission, self._node.safety
        figures["mission_state"] = mission.state if mission is not None else ""
        figures["mission_reason"] = mission.reason if mission is not None else ""
        figures["emergency_stop"] = bool(safety is not None and safety.safety_state == safety.EMERGENCY_STOP)
        return figures

    def _spin(self) -> None:
        """Raises RunFailed when the world has fallen silent."""
        before = len(self._node.run_log.moments)
        self._node.spin()
        if len(self._node.run_log.moments) > before:
            self._heard_at_s = time.monotonic()
        elif time.monotonic() - self._heard_at_s > _SILENCE_S:
            raise RunFailed("the world has fallen silent")

    def _wait(self, condition: Callable[[], bool], limit_s: float, problem: str) -> None:
        end_s = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > end_s:
                raise RunFailed(f"{problem} ({self._node.describe()})")
            self._node.spin()
        self._heard_at_s = time.monotonic()
