"""Route requests and results. A request is a snapshot, so planning may take long.

The follower requests a route and continues its tick; the newest request wins, and its result is polled. Nodes
plan in a thread of their own (``robot_stack.navigation.background_planner``), benchmarks and tests at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import Footprint
from robot_stack.navigation.cancel_flag import CancelFlag
from robot_stack.navigation.global_planner import GlobalPlanner, NoWay
from robot_stack.navigation.lanes import LaneRoute, Lanes
from robot_stack.navigation.params import PlannerParams
from robot_stack.navigation.path import Path
from robot_stack.navigation.planning_grid import PlanningGrid, empty_grid

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RouteRequest:
    """Poses in map. seen: (n, 2) obstacle points in map beyond those of the site's map; read-only.

    at_map: (n, 2) those seen at obstacles of the map. An error of the pose doubles these: they are left out where they
    leave no way.
    """

    start: Pose2
    goal: Pose2
    footprint: Footprint
    seen: Array
    at_map: Array = field(default_factory=lambda: np.empty((0, 2)))


@dataclass(frozen=True, slots=True)
class RouteResult:
    """route: None without a way; ``reason`` is the cause.

    lasting: the site's map alone leaves no way, so that waiting changes nothing.
    """

    route: Path | None
    reason: str = ""
    lasting: bool = False


class RoutePlanner(Protocol):
    """Plans the newest request."""

    def ask(self, question: RouteRequest) -> None:
        """Requests a route; cancels the previous request."""

    def take(self) -> RouteResult | None:
        """The result of the newest request, once; None until it is available."""

    def drop(self) -> None:
        """Cancels the newest request."""


class RouteSolver:
    """Results are a pure function of request and site. site: the map's grid, None without a map.

    lanes: of the site's route graph. A lane that seen obstacles block is excluded as long as they are remembered.
    """

    def __init__(self, params: PlannerParams, site: PlanningGrid | None, lanes: Lanes | None = None) -> None:
        self._params, self._lanes = params, lanes
        self._site = None if site is None else site.view()

    def solve(self, question: RouteRequest, stop: CancelFlag) -> RouteResult:
        """stop: once set, this returns soon and its result is invalid."""
        p, grid = self._params, self._site
        if grid is None:
            empty = empty_grid(question.start, question.goal, p.open_pad_m, p.open_resolution_m)
            grid = PlanningGrid(empty, bounded=False)
        everything = np.concatenate((question.seen, question.at_map))
        found = self._plan_on_lanes(grid, question, stop) or self._plan(grid, question, everything, stop)
        if isinstance(found, NoWay) and len(question.at_map):
            found = self._plan(grid, question, question.seen, stop)
        if not isinstance(found, NoWay):
            return RouteResult(found)
        # Only the map's own obstacles are permanent.
        nothing = question.seen[:0]
        by_map = self._plan(grid, question, nothing, stop, doubtful=True) if len(question.seen) else found
        if isinstance(by_map, NoWay) and self._site is not None:
            return RouteResult(None, by_map.reason, lasting=True)
        return RouteResult(None, found.reason)

    def _plan_on_lanes(self, grid: PlanningGrid, question: RouteRequest, stop: CancelFlag) -> Path | None:
        """A route over the graph around the seen obstacles; None if there is none, or lanes are not used."""
        if self._lanes is None:
            return None
        start, goal = (np.array((pose.x, pose.y)) for pose in (question.start, question.goal))
        grid.lay_over(question.seen)
        closed: set[int] = set()
        for _ in range(self._lanes.tries):
            route = self._lanes.route(start, goal, frozenset(closed))
            if route is None or stop.is_set:
                return None
            guide = self._lanes.guide(grid, route, start, goal)
            planner = GlobalPlanner(grid, self._params, stop, guide=guide)
            found = planner.plan(question.start, question.goal, question.footprint)
            if isinstance(found, Path):
                return found
            blocked = self._blocked(grid, question, route, stop)
            if not blocked and found.tight is not None:
                blocked = self._lanes.entered(route, found.tight)
            # If each lane is passable, the way to the first or from the last one is not.
            closed |= blocked or {int(route.lanes[0]), int(route.lanes[-1])}
        return None

    def _blocked(self, grid: PlanningGrid, question: RouteRequest, route: LaneRoute, stop: CancelFlag) -> set[int]:
        """The lanes of a route, which has no way, that leave none by themselves. Headings are not judged: those at the
        ends of a lane depend on the next one."""
        assert self._lanes is not None
        blocked = set()
        for lane, (a, b) in route.pieces():
            if stop.is_set:
                break
            if math.dist(a, b) < grid.resolution_m:
                continue
            planner = GlobalPlanner(grid, self._params, stop, guide=self._lanes.piece_guide(grid, np.array([a, b])))
            start, goal = (Pose2(float(x), float(y), 0.0) for x, y in (a, b))
            if not planner.has_positions(start, goal, question.footprint):
                blocked.add(lane)
        return blocked

    def _plan(
        self, grid: PlanningGrid, question: RouteRequest, seen: Array, stop: CancelFlag, *, doubtful: bool = False
    ) -> Path | NoWay:
        grid.lay_over(seen)
        planner = GlobalPlanner(grid, self._params, stop, doubtful=doubtful)
        return planner.plan(question.start, question.goal, question.footprint)


class PromptRoutes:
    """A planner that plans synchronously in ``ask``."""

    def __init__(self, solver: RouteSolver) -> None:
        self._solver = solver
        self._answer: RouteResult | None = None

    def ask(self, question: RouteRequest) -> None:
        self._answer = self._solver.solve(question, CancelFlag())

    def take(self) -> RouteResult | None:
        answer, self._answer = self._answer, None
        return answer

    def drop(self) -> None:
        self._answer = None
