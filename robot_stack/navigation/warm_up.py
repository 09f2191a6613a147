"""Compiles the kernels of navigation among obstacles, or loads them, before the first goal."""

from __future__ import annotations

import numpy as np

from robot_stack.core.config import load
from robot_stack.core.departure import Departure, DepartureParams
from robot_stack.core.geometry import ZERO_TWIST, Pose2
from robot_stack.core.robot import load_robot
from robot_stack.core.site_map import Grid
from robot_stack.core.zones import Zone, ZoneType
from robot_stack.navigation.cancel_flag import CancelFlag
from robot_stack.navigation.controller import NavigationController, Situation
from robot_stack.navigation.goal import GoalRequest
from robot_stack.navigation.params import NavigationParams
from robot_stack.navigation.planning_grid import PlanningGrid
from robot_stack.navigation.pose_source import Located
from robot_stack.navigation.tight_passage import passage
from robot_stack.navigation.yielding import way_out

_CELLS, _RESOLUTION_M = 200, 0.05
_CORNER = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 0.0)])


def warm_up() -> None:
    """Runs one short navigation with a wall in the way; only the compiled code is kept."""
    params = load(NavigationParams, "navigation_controller", {"use_costmap": True})
    robot = load_robot()
    occupancy = np.zeros((100, 100), np.int8)
    occupancy[40:60, 50] = 100
    cells = np.zeros((_CELLS, _CELLS), np.int8)
    cells[80:120, 100] = 100
    cells[40:44, 40:44] = 100
    controller = NavigationController(
        params,
        robot,
        "map",
        Departure(load(DepartureParams, "departure"), announced=True),
        Grid(0.1, 0.0, 0.0, occupancy),
        zones=(
            Zone("ward", ZoneType.SPEED, (_CORNER,), 1.0),
            Zone("lane", ZoneType.ONE_WAY, (_CORNER,), np.inf, 0.0),
        ),
    )
    start = Pose2(2.0, 5.0, 0.0)
    located = Located(start, ZERO_TWIST)
    controller.around.on_people(1.0, (), 1.0)
    controller.around.on_costmap(1.0, _RESOLUTION_M, Pose2(0.0, 0.0, 0.0), cells, 1.0)
    goal = GoalRequest("map", 0.0, (8.0, 5.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    controller.request(goal, 1.0, located)
    controller.tick(Situation(1.0, located))
    cells = np.roll(cells, 2, axis=0)
    controller.around.on_people(1.2, (), 1.2)
    controller.around.on_costmap(1.2, _RESOLUTION_M, Pose2(0.0, 0.0, 0.0), cells, 1.2)
    controller.tick(Situation(1.05, located))
    local = controller.around.local
    assert local is not None
    ahead = np.array([(start.x + 1.0, start.y, 0.0, 0.0, 0.25, 0.22)])
    way_out(start, robot.footprint, local, ahead, params.local.governor_margin_m, params.give_way)
    grid = PlanningGrid(Grid(0.1, 0.0, 0.0, occupancy))
    ends = np.array([(2.0, 5.0, 0.0), (2.5, 5.0, 0.0)])
    passage(grid, robot.footprint, params.planner, ends[0], ends[1], CancelFlag(), any_heading=False)
