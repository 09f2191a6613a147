"""The route of the body to a goal: A* over positions, straightened, then the cheapest heading at every point.

Positions keep the footprint's half width clear, and prefer the middle between obstacles. The robot can drive to any
side, but its sensors cover the front best: the heading follows the way where the oriented footprint is clear, and does
not turn for a short step sideways. If no heading is clear, the place is closed and another way is searched.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import Pose2, wrap_angle
from robot_stack.core.robot import Footprint
from robot_stack.navigation.cancel_flag import CancelFlag
from robot_stack.navigation.footprint import outline
from robot_stack.navigation.goal import GoalCode, Refusal
from robot_stack.navigation.grid_kernels import (
    EASY,
    NO_GUIDE,
    TIGHT,
    Ground,
    Prices,
    Singles,
    astar,
    heading_room,
    headings,
    relax,
    straighten,
)
from robot_stack.navigation.params import PlannerParams
from robot_stack.navigation.path import Path
from robot_stack.navigation.planning_grid import FAR_M, PlanningGrid
from robot_stack.navigation.tight_passage import LEAVING_M, passage

Array = npt.NDArray[np.float64]
_HEADING_STEP_M = 0.2
_LINE_STEPS = 400
# Cosine between heading and course below which the robot goes backwards.
_BACKWARDS = -0.3
# Largest number of narrow places per way that are searched over positions and headings together.
_PASSAGES = 3
# Cells of the flood around the goal, 800 m2: detects an enclosed goal at once.
_FLOOD_CELLS = 20_000


@dataclass(frozen=True, slots=True)
class NoWay:
    """reason: why there is no way, for people. tight: the first point found too narrow for the footprint, map."""

    reason: str
    tight: tuple[float, float] | None = None


def goal_problem(grid: PlanningGrid, footprint: Footprint, goal: Pose2, params: PlannerParams) -> Refusal | None:
    """Why the map alone excludes ``goal``, else None."""
    if not grid.bounded:
        return None
    name = f"goal ({goal.x:.2f}, {goal.y:.2f})"
    if not grid.contains(goal.x, goal.y):
        return Refusal(GoalCode.GOAL_OUTSIDE_MAP, f"{name} lies outside the map")
    row, column = grid.cell(goal.x, goal.y)
    if grid.unknown[row, column] and not params.unknown_is_passable:
        return Refusal(GoalCode.GOAL_OCCUPIED, f"{name} lies in unknown space of the map")
    pose = np.array([(goal.x, goal.y, goal.yaw)])
    clear_m = float(grid.clearance_m(outline(footprint), pose, known=True)[0]) - grid.half_cell_m
    if clear_m < params.goal_margin_m:
        text = f"the footprint would have {clear_m:.2f} m to an obstacle of the map, limit {params.goal_margin_m} m"
        return Refusal(GoalCode.GOAL_OCCUPIED, f"{name}: {text}")
    return None


class GlobalPlanner:
    """Routes over one grid. A plan is a pure function of its arguments and of the grid with its overlay."""

    def __init__(
        self,
        grid: PlanningGrid,
        params: PlannerParams,
        stop: CancelFlag | None = None,
        *,
        doubtful: bool = False,
        guide: Singles = NO_GUIDE,
    ) -> None:
        """stop: once set, a plan ends soon, without a way. doubtful: optimised to detect early that there is none.

        guide: additional cost of the grid's cells, see ``grid_kernels.astar``.
        """
        self.grid, self._guide = grid, guide
        self._params = params
        self._stop = stop or CancelFlag()
        self._flood_cells = grid.field.size if doubtful else _FLOOD_CELLS

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
            if self._stop.is_set:
                return NoWay("cancelled")
            points = self._points(start, goal, footprint, closed)
            if points is None:
                problem = problem or f"no path from ({start.x:.1f}, {start.y:.1f}) to ({goal.x:.1f}, {goal.y:.1f})"
                return NoWay(problem, closed[0] if closed else None)
            route, tight = self._turned(points, start, goal, footprint)
            if route is not None:
                return route
            closed.append((float(tight[0]), float(tight[1])))
            problem = f"too narrow for the footprint at ({tight[0]:.1f}, {tight[1]:.1f})"
        return NoWay(problem, closed[0])

    def has_positions(self, start: Pose2, goal: Pose2, footprint: Footprint) -> bool:
        """Whether there is a way for the narrowest outline of the footprint, whatever its headings."""
        inside = all(self.grid.contains(pose.x, pose.y) for pose in (start, goal))
        return inside and self._points(start, goal, footprint, []) is not None

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
        # In no pose of the footprint base_link comes nearer to an obstacle: an escape does not lead through a wall.
        dot, here = np.zeros((1, 2)), np.array([(start.x, start.y, 0.0)])
        escape_m = min(footprint.inscribed_m(), float(grid.clearance_m(dot, here)[0])) - grid.resolution_m
        ground = Ground(field, grid.unknown, grid.courses, self._guide)
        prices = Prices(radius_m, prefer_m, p.near_cost, unknown_cost if math.isfinite(unknown_cost) else 1.0)
        found = astar(
            ground,
            prices,
            factor,
            first,
            last,
            escape_m,
            p.heuristic_weight,
            np.array(cells, np.int64).reshape(-1, 3),
            math.ceil(p.escape_m / coarse_m),
            self._flood_cells,
            self._stop.flag,
        )
        if not len(found):
            return None
        points = np.asarray((found[:, ::-1] + 0.5) * coarse_m + (grid.x_m, grid.y_m), np.float64)
        points[0], points[-1] = (start.x, start.y), (goal.x, goal.y)
        if len(points) == 1:
            points = np.array([(start.x, start.y), (goal.x, goal.y)])
        place = grid.resolution_m, grid.x_m, grid.y_m
        points = straighten(ground, prices._replace(unknown_cost=p.unknown_cost), place, points, _LINE_STEPS)
        points = _evenly(points, _HEADING_STEP_M)
        return relax(field, *place, points, radius_m, p.rounding, grid.courses)

    # --- headings ----------------------------------------------------------------------------------------------------

    def _turned(self, points: Array, start: Pose2, goal: Pose2, footprint: Footprint) -> tuple[Path | None, Array]:
        """(route, anything), or (None, the point that cannot be passed)."""
        grid, p = self.grid, self._params
        ends = np.array([(start.x, start.y, start.yaw), (goal.x, goal.y, goal.yaw)])
        at_ends = grid.clearance_m(outline(footprint), ends)
        if at_ends[1] < p.goal_margin_m + grid.half_cell_m:
            return None, points[-1]
        poses, tight = self._headed(points, ends, at_ends, footprint, _PASSAGES)
        if poses is None:
            return None, tight
        poses[0, 2], poses[-1, 2] = start.yaw, goal.yaw
        poses[:, 2] = [wrap_angle(yaw) for yaw in poses[:, 2]]
        return Path(poses), points[0]

    def _headed(
        self, points: Array, ends: Array, at_ends: Array, footprint: Footprint, passages: int
    ) -> tuple[Array | None, Array]:
        """((n, 3) poses, anything), or (None, the point that cannot be passed).

        ends: (2, 3) poses. at_ends: (2,) clearance there. passages: limit of narrow places to search again.
        """
        bins = self._params.heading_bins
        requested, step_m = _course(points, float(ends[0, 2]))
        along = np.cumsum(step_m)
        margin = self._margins(along, at_ends)
        place = self.grid.resolution_m, self.grid.x_m, self.grid.y_m
        edge = outline(footprint)
        p, easy_m = self._params, self._params.easy_margin_m + self.grid.half_cell_m
        radii_m = footprint.circumscribed_m(), footprint.inscribed_m()
        room = heading_room(self.grid.field, *place, edge, points, bins, margin, easy_m, *radii_m)
        first, last = (round(float(yaw) / (2.0 * math.pi) * bins) % bins for yaw in ends[:, 2])
        room[0, first] = room[-1, last] = EASY
        picked = headings(room, requested, step_m, first, last, p.turn_cost_m_per_rad, p.near_cost)
        possible = picked[0] >= 0
        yaws = np.unwrap(picked * (2.0 * math.pi / bins)) if possible else requested
        tight = int(picked[1]) if not possible else None
        if possible:
            tight = _backwards(yaws - requested, along, 2.0 * radii_m[0])
            grazing = np.flatnonzero(room[np.arange(len(points)), picked] == TIGHT)
            tight = int(grazing[0]) if tight is None and len(grazing) else tight
        if tight is not None and passages:
            through = self._through(points, along, requested, ends, at_ends, tight, footprint, passages)
            if through is not None:
                return through, points[tight]
        if not possible:
            assert tight is not None
            return None, points[tight]
        return np.column_stack((points, self._exact(points, yaws, requested, margin, edge))), points[0]

    def _through(
        self,
        points: Array,
        along: Array,
        requested: Array,
        ends: Array,
        at_ends: Array,
        tight: int,
        footprint: Footprint,
        passages: int,
    ) -> Array | None:
        """The way with the stretch around a narrow place searched over positions and headings together."""
        around_m = 2.0 * footprint.circumscribed_m()
        into = max(0, int(np.searchsorted(along, along[tight] - around_m)) - 1)
        out = min(len(points) - 1, int(np.searchsorted(along, along[tight] + around_m)))
        start = ends[0] if into == 0 else np.array([*points[into], requested[into]])
        goal = ends[1] if out == len(points) - 1 else np.array([*points[out], requested[out]])
        middle = passage(
            self.grid,
            footprint,
            self._params,
            start,
            goal,
            self._stop,
            any_heading=out < len(points) - 1,
            escapes=into == 0,
        )
        if middle is None:
            return None
        before = after = middle[:0]
        if into > 0:
            clear = np.array([at_ends[0], FAR_M])
            head, _ = self._headed(points[: into + 1], np.array([ends[0], middle[0]]), clear, footprint, passages - 1)
            if head is None:
                return None
            before = head[:-1]
        if out < len(points) - 1:
            clear = np.array([FAR_M, at_ends[1]])
            tail, _ = self._headed(points[out:], np.array([middle[-1], ends[1]]), clear, footprint, passages - 1)
            if tail is None:
                return None
            after = tail[1:]
        return np.concatenate((before, middle, after))

    def _margins(self, along_m: Array, at_ends: Array) -> Array:
        """(n,) required clearance, m; near a tight start or goal it is reduced to the clearance there."""
        p, grid = self._params, self.grid
        margin_m = p.margin_m + grid.half_cell_m
        margin = np.full(len(along_m), margin_m)
        margin[along_m <= p.escape_m] = min(margin_m, at_ends[0] - LEAVING_M)
        near_goal = along_m >= along_m[-1] - p.escape_m
        margin[near_goal] = np.minimum(margin[near_goal], at_ends[1] - grid.resolution_m)
        return margin

    def _exact(self, points: Array, yaws: Array, requested: Array, margin: Array, edge: Array) -> Array:
        """Headings between the steps of the search: the course itself, if within a step and clear."""
        off = np.array([wrap_angle(a) for a in requested - yaws])
        refined = np.where(np.abs(off) <= 2.0 * math.pi / self._params.heading_bins, yaws + off, yaws)
        smooth = refined.copy()
        for _ in range(3):
            smooth[1:-1] = 0.25 * smooth[:-2] + 0.5 * smooth[1:-1] + 0.25 * smooth[2:]
        clear = self.grid.clearance_m(edge, np.column_stack((points, smooth))) >= margin
        return np.where(clear, smooth, yaws)


def _course(points: Array, yaw: float) -> tuple[Array, Array]:
    """((n,) course, (n,) metres from the point before) of (n, 2) points; a single point looks along ``yaw``."""
    steps = np.diff(points, axis=0)
    step_m = np.concatenate(([0.0], np.hypot(*steps.T)))
    course = np.arctan2(steps[:, 1], steps[:, 0]) if len(steps) else np.array([yaw])
    return np.concatenate((course[:1], course))[: len(points)], step_m


def _backwards(off: Array, along_m: Array, ends_m: float) -> int | None:
    """Index of the first point, not within ``ends_m`` of an end, that is driven through backwards.

    The sensors cover the rear badly. A route backs through a gate where it left no room to turn before it.
    """
    inner = (along_m > ends_m) & (along_m < along_m[-1] - ends_m)
    where = np.flatnonzero(inner & (np.cos(off) < _BACKWARDS))
    return int(where[0]) if len(where) else None


def _evenly(points: Array, spacing_m: float) -> Array:
    """(m, 2) points about ``spacing_m`` apart on the lines through ``points``, corners and ends included."""
    pieces = [points[:1]]
    for a, b in pairwise(points):
        count = max(1, math.ceil(float(np.hypot(*(b - a))) / spacing_m))
        pieces.append(a + (b - a) * (np.arange(1, count + 1)[:, None] / count))
    return np.concatenate(pieces)
