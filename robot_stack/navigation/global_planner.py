"""The route of the body to a goal: A* over positions, straightened, then the cheapest heading at every point.

Positions keep the footprint's half width clear, and prefer the middle between obstacles. The robot can drive to any
side, but sees and looks best forward: the heading follows the way where the oriented footprint is clear, and does not
turn for a short step sideways. Where no heading is clear the place is closed and another way is sought.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import Pose2, wrap_angle
from robot_stack.core.robot import Footprint
from robot_stack.navigation.footprint import outline, reach_m
from robot_stack.navigation.grid_kernels import astar, free_headings, headings, relax, straighten
from robot_stack.navigation.params import PlannerParams
from robot_stack.navigation.path import Path
from robot_stack.navigation.planning_grid import PlanningGrid

Array = npt.NDArray[np.float64]
_HEADING_STEP_M = 0.2
_LINE_STEPS = 400


@dataclass(frozen=True, slots=True)
class NoWay:
    """reason: why there is no way, for people."""

    reason: str


def goal_problem(grid: PlanningGrid, footprint: Footprint, goal: Pose2, params: PlannerParams) -> str:
    """Why nobody can stand at ``goal`` by the map alone, else an empty text."""
    if not grid.bounded:
        return ""
    if not grid.contains(goal.x, goal.y):
        return f"goal ({goal.x:.2f}, {goal.y:.2f}) lies outside the map"
    row, column = grid.cell(goal.x, goal.y)
    if grid.unknown[row, column] and not params.unknown_is_passable:
        return f"goal ({goal.x:.2f}, {goal.y:.2f}) lies where the map knows nothing"
    pose = np.array([(goal.x, goal.y, goal.yaw)])
    clear_m = float(grid.clearance_m(outline(footprint), pose, known=True)[0]) - grid.half_cell_m
    if clear_m < params.goal_margin_m:
        return (
            f"goal ({goal.x:.2f}, {goal.y:.2f}): the footprint would have {clear_m:.2f} m to an obstacle of the map, "
            f"limit {params.goal_margin_m} m"
        )
    return ""


class GlobalPlanner:
    """Routes over one grid. A plan is a pure function of its arguments and of what was laid over the grid."""

    def __init__(self, grid: PlanningGrid, params: PlannerParams) -> None:
        self.grid = grid
        self._params = params

    def plan(self, start: Pose2, goal: Pose2, footprint: Footprint) -> Path | NoWay:
        """Poses at most heading-step apart, from ``start`` to ``goal`` inclusive."""
        if not (start.is_finite() and goal.is_finite()):
            return NoWay("start or goal is not finite")
        for name, pose in (("start", start), ("goal", goal)):
            if not self.grid.contains(pose.x, pose.y):
                return NoWay(f"{name} ({pose.x:.2f}, {pose.y:.2f}) lies outside the map")
        closed: list[tuple[float, float]] = []
        problem = ""
        for _ in range(self._params.tries):
            points = self._points(start, goal, footprint, closed)
            if points is None:
                return NoWay(problem or f"no way from ({start.x:.1f}, {start.y:.1f}) to ({goal.x:.1f}, {goal.y:.1f})")
            route, tight = self._turned(points, start, goal, footprint)
            if route is not None:
                return route
            closed.append((float(tight[0]), float(tight[1])))
            problem = f"too narrow for the footprint at ({tight[0]:.1f}, {tight[1]:.1f})"
        return NoWay(problem)

    # --- positions ---------------------------------------------------------------------------------------------------

    def _points(
        self, start: Pose2, goal: Pose2, footprint: Footprint, closed: list[tuple[float, float]]
    ) -> Array | None:
        """(n, 2) positions along the way, evenly spaced; None if there is none."""
        grid, p = self.grid, self._params
        radius_m = 0.5 * footprint.width_m + p.margin_m + grid.half_cell_m
        prefer_m = radius_m + p.prefer_m
        factor = max(1, round(p.search_resolution_m / grid.resolution_m))
        coarse_m = factor * grid.resolution_m
        unknown_cost = p.unknown_cost if p.unknown_is_passable else math.inf
        field = grid.field if p.unknown_is_passable else np.where(grid.unknown, np.float32(0.0), grid.field)
        first, last = ((r // factor, c // factor) for r, c in (grid.cell(q.x, q.y) for q in (start, goal)))
        disc = max(1, math.ceil(p.closed_radius_m / coarse_m))
        cells = [(grid.cell(x, y)[0] // factor, grid.cell(x, y)[1] // factor, disc) for x, y in closed]
        found = astar(
            field,
            grid.unknown,
            factor,
            first,
            last,
            radius_m,
            prefer_m,
            p.near_cost,
            unknown_cost if math.isfinite(unknown_cost) else 1.0,
            p.heuristic_weight,
            np.array(cells, np.int64).reshape(-1, 3),
            math.ceil(p.escape_m / coarse_m),
        )
        if not len(found):
            return None
        points = np.asarray((found[:, ::-1] + 0.5) * coarse_m + (grid.x_m, grid.y_m), np.float64)
        points[0], points[-1] = (start.x, start.y), (goal.x, goal.y)
        if len(points) == 1:
            points = np.array([(start.x, start.y), (goal.x, goal.y)])
        place = grid.resolution_m, grid.x_m, grid.y_m
        cost = radius_m, prefer_m, p.near_cost, p.unknown_cost
        points = straighten(field, grid.unknown, *place, points, *cost, _LINE_STEPS)
        points = _evenly(points, _HEADING_STEP_M)
        return relax(field, *place, points, radius_m, p.rounding)

    # --- headings ----------------------------------------------------------------------------------------------------

    def _turned(self, points: Array, start: Pose2, goal: Pose2, footprint: Footprint) -> tuple[Path | None, Array]:
        """(route, anything), or (None, the point that cannot be passed)."""
        grid, p = self.grid, self._params
        edge, bins = outline(footprint), p.heading_bins
        place = grid.resolution_m, grid.x_m, grid.y_m
        steps = np.diff(points, axis=0)
        step_m = np.concatenate(([0.0], np.hypot(*steps.T)))
        course = np.arctan2(steps[:, 1], steps[:, 0]) if len(steps) else np.array([start.yaw])
        wish = np.concatenate((course[:1], course))
        ends = np.array([(start.x, start.y, start.yaw), (goal.x, goal.y, goal.yaw)])
        at_ends = grid.clearance_m(edge, ends)
        # Out of a tight spot, and into one, the footprint may pass as near as it stands there.
        along = np.cumsum(step_m)
        margin_m = p.margin_m + grid.half_cell_m
        margin = np.full(len(points), margin_m)
        margin[along <= p.escape_m] = min(margin_m, at_ends[0] - grid.resolution_m)
        near_goal = along >= along[-1] - p.escape_m
        margin[near_goal] = np.minimum(margin[near_goal], at_ends[1] - grid.resolution_m)
        free = free_headings(grid.field, *place, edge, points, bins, margin, reach_m(footprint))
        first, last = (round(yaw / (2.0 * math.pi) * bins) % bins for yaw in (start.yaw, goal.yaw))
        free[0, first] = free[-1, last] = True
        if at_ends[1] < p.goal_margin_m + grid.half_cell_m:
            return None, points[-1]
        picked = headings(free, wish, step_m, first, last, p.turn_cost_m_per_rad)
        if picked[0] < 0:
            return None, points[picked[1]]
        yaws = np.unwrap(picked * (2.0 * math.pi / bins))
        yaws = self._exact(points, yaws, wish, margin, edge)
        yaws[0], yaws[-1] = start.yaw, goal.yaw
        wrapped = np.array([wrap_angle(yaw) for yaw in yaws])
        return Path(np.column_stack((points, wrapped))), points[0]

    def _exact(self, points: Array, yaws: Array, wish: Array, margin: Array, edge: Array) -> Array:
        """Headings between the steps of the search: the course itself, where it is as near and clear."""
        off = np.array([wrap_angle(a) for a in wish - yaws])
        refined = np.where(np.abs(off) <= 2.0 * math.pi / self._params.heading_bins, yaws + off, yaws)
        smooth = refined.copy()
        for _ in range(3):
            smooth[1:-1] = 0.25 * smooth[:-2] + 0.5 * smooth[1:-1] + 0.25 * smooth[2:]
        clear = self.grid.clearance_m(edge, np.column_stack((points, smooth))) >= margin
        return np.where(clear, smooth, yaws)


def _evenly(points: Array, spacing_m: float) -> Array:
    """(m, 2) points about ``spacing_m`` apart on the lines through ``points``, corners and ends included."""
    pieces = [points[:1]]
    for a, b in pairwise(points):
        count = max(1, math.ceil(float(np.hypot(*(b - a))) / spacing_m))
        pieces.append(a + (b - a) * (np.arange(1, count + 1)[:, None] / count))
    return np.concatenate(pieces)
