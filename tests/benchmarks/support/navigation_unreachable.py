"""Unreachable goals on a site of 300 m x 300 m, at the real rate: time to the refusal and cost per tick."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robot_stack.core.config import load
from robot_stack.core.departure import Departure, DepartureParams
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2
from robot_stack.core.robot import Robot
from robot_stack.core.site_map import FREE, OCCUPIED, Grid
from robot_stack.navigation.background_planner import BackgroundPlanner
from robot_stack.navigation.controller import NavigationController, Situation
from robot_stack.navigation.goal import GoalRequest
from robot_stack.navigation.params import NavigationParams
from robot_stack.navigation.pose_source import Located
from robot_stack.navigation.routes import RouteSolver
from robot_stack.ros.workers import ThreadWorker

Cells = npt.NDArray[np.int8]
_CELLS, _RESOLUTION_M, _TICK_S = 3000, 0.1, 0.05
_START, _GOAL = Pose2(0.8, 0.8, 0.0), Pose2(299.0, 299.0, 0.0)
_LIMIT_S = 20.0


@dataclass(frozen=True, slots=True)
class Refused:
    """reported_s: real time from the goal to the refusal; cpu_s: CPU time of all threads until then.

    wall_ms, cpu_ms: of each tick until a second after the refusal.
    """

    reported_s: float
    cpu_s: float
    text: str
    times: int
    wall_ms: list[float]
    cpu_ms: list[float]


def town() -> Cells:
    """Blocks of houses."""
    random = np.random.default_rng(7)
    cells = np.full((_CELLS, _CELLS), FREE, np.int8)
    for row in range(0, _CELLS, 250):
        for column in range(0, _CELLS, 250):
            height, width = random.integers(120, 225, 2)
            cells[row + 15 : row + 15 + height, column + 15 : column + 15 + width] = OCCUPIED
    return cells


def sites() -> dict[str, Cells]:
    """By name, sites without a route from one corner to the other."""
    closed_in, river, field = town(), town(), np.full((_CELLS, _CELLS), FREE, np.int8)
    closed_in[2960:2964, 2960:] = closed_in[2960:, 2960:2964] = OCCUPIED
    river[1490:1496, :] = field[1490:1496, :] = OCCUPIED
    return {"goal closed in": closed_in, "town with a river": river, "field with a river": field}


def refuse(cells: Cells, params: NavigationParams, robot: Robot) -> Refused:
    """Requests one goal from the controller with its worker, ticking in real time."""
    planners: list[BackgroundPlanner] = []

    def routes(solver: RouteSolver) -> BackgroundPlanner:
        planners.append(BackgroundPlanner(solver, ThreadWorker("planning", lambda deliver: deliver())))
        return planners[0]

    announced = Departure(load(DepartureParams, "departure"), announced=True)
    grid = Grid(_RESOLUTION_M, 0.0, 0.0, cells)
    controller = NavigationController(params, robot, "map", announced, grid, routes)
    try:
        return _ticks(controller)
    finally:
        planners[0].close(2.0)


def _ticks(controller: NavigationController) -> Refused:
    half = 0.5 * _GOAL.yaw
    goal = GoalRequest("map", 0.0, (_GOAL.x, _GOAL.y, 0.0), (0.0, 0.0, math.sin(half), math.cos(half)))
    located = Located(_START, ZERO_TWIST, IDENTITY)
    costmap = np.zeros((200, 200), np.int8)
    costmap[150:152, 60:140] = 100  # in the costmap, not in the map: the planner also checks the map alone
    reported_s, used_s, text = math.nan, math.nan, ""
    wall_ms: list[float] = []
    cpu_ms: list[float] = []
    cpu_began_s = time.process_time()
    began_s = time.monotonic()
    end_s = began_s + _LIMIT_S
    times = ticks = 0
    while time.monotonic() < end_s:
        wall_s, cpu_s, now_s = time.perf_counter(), time.thread_time(), ticks * _TICK_S
        if ticks % 4 == 0:
            controller.around.on_people(now_s, (), now_s)
            controller.around.on_costmap(now_s, 0.05, Pose2(-4.2, -4.2, 0.0), costmap, now_s)
        if ticks == 0:
            controller.request(goal, now_s, located)
        output = controller.tick(Situation(now_s, located))
        wall_ms.append(1e3 * (time.perf_counter() - wall_s))
        cpu_ms.append(1e3 * (time.thread_time() - cpu_s))
        if output.end is not None:
            times += 1
            used_s = time.process_time() - cpu_began_s
            reported_s, text, end_s = time.monotonic() - began_s, output.text, time.monotonic() + 1.0
        ticks += 1
        time.sleep(max(0.0, began_s + ticks * _TICK_S - time.monotonic()))
    return Refused(reported_s, used_s, text, times, wall_ms, cpu_ms)
