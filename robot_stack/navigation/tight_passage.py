"""A stretch of a route through a narrow place, searched over positions and headings together."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import wrap_angle
from robot_stack.core.robot import Footprint
from robot_stack.navigation.cancel_flag import CancelFlag
from robot_stack.navigation.footprint import outline
from robot_stack.navigation.grid_kernels import CLOSED, EASY, Rooms, clearances, heading_room, line_permits
from robot_stack.navigation.one_way import ALL_COURSES, FREE_COURSES, Courses
from robot_stack.navigation.params import PlannerParams
from robot_stack.navigation.planning_grid import PlanningGrid
from robot_stack.navigation.pose_search import search_poses

Array = npt.NDArray[np.float64]
_STEP_M = 0.1
_STEP_RAD = 0.1
# A robot that stands nearer to an obstacle than the margin may come this much nearer on its way out.
LEAVING_M = 0.02


@dataclass(frozen=True, slots=True)
class _Window:
    """A piece of the grid: south-west corner (m), cells, room of their headings, cost and courses of each cell."""

    x_m: float
    y_m: float
    room: Rooms
    cost: Array
    courses: Courses

    def cell(self, pose: Array) -> tuple[int, int]:
        rows, columns = self.cost.shape
        row, column = math.floor((pose[1] - self.y_m) / _STEP_M), math.floor((pose[0] - self.x_m) / _STEP_M)
        return min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)

    def poses(self, found: npt.NDArray[np.int64]) -> Array:
        unit = 2.0 * math.pi / self.room.shape[2]
        x = self.x_m + (found[:, 1] + 0.5) * _STEP_M
        y = self.y_m + (found[:, 0] + 0.5) * _STEP_M
        return np.column_stack((x, y, unit * found[:, 2]))


def passage(
    grid: PlanningGrid,
    footprint: Footprint,
    params: PlannerParams,
    start: Array,
    goal: Array,
    stop: CancelFlag,
    *,
    any_heading: bool,
    escapes: bool = True,
) -> Array | None:
    """(n, 3) poses from ``start`` to ``goal`` (both (3,), map), both included; None if there is no way.

    any_heading: the goal's heading is free; the last pose has the one found. stop: ends the search.
    escapes: the robot stands at the start and may go against one-way zones within ``escape_m`` of it.
    """
    margin_m = params.margin_m + grid.half_cell_m
    window = _window(grid, footprint, params, start, goal, margin_m, LEAVING_M)
    escape_m = params.escape_m if escapes else 0.0
    found = _searched(window, params, start, goal, stop, escape_m, any_heading=any_heading)
    leaving = float(grid.clearance_m(outline(footprint), start[None])[0]) < margin_m + grid.resolution_m
    if not len(found) and leaving:
        # The search begins at the nearest cell and heading, which may be nearer to the obstacle than the robot is.
        window = _window(grid, footprint, params, start, goal, margin_m, grid.resolution_m)
        found = _searched(window, params, start, goal, stop, escape_m, any_heading=any_heading)
    if not len(found):
        return None
    poses = window.poses(found)
    poses[:, 2] = np.unwrap(poses[:, 2])
    poses[0] = start[0], start[1], poses[0, 2] + wrap_angle(float(start[2] - poses[0, 2]))
    end_yaw = poses[-1, 2] if any_heading else poses[-1, 2] + wrap_angle(float(goal[2] - poses[-1, 2]))
    poses[-1] = goal[0], goal[1], end_yaw
    return _straightened(grid, outline(footprint), poses, margin_m, params.easy_margin_m + grid.half_cell_m)


def _searched(
    window: _Window,
    params: PlannerParams,
    start: Array,
    goal: Array,
    stop: CancelFlag,
    escape_m: float,
    *,
    any_heading: bool,
) -> npt.NDArray[np.int64]:
    bins = params.heading_bins
    first, last = (round(float(pose[2]) / (2.0 * math.pi) * bins) % bins for pose in (start, goal))
    from_cell, to_cell = window.cell(start), window.cell(goal)
    # Both ends are given and count as free.
    window.room[(*from_cell, first)] = EASY
    if not any_heading:
        window.room[(*to_cell, last)] = EASY
    return search_poses(
        window.room,
        window.cost,
        (*from_cell, first),
        (*to_cell, -1 if any_heading else last),
        _STEP_M,
        params.turn_cost_m_per_rad,
        params.near_cost,
        params.heuristic_weight,
        window.courses,
        math.floor(escape_m / _STEP_M + 1e-9),
        stop.flag,
    )


def _window(
    grid: PlanningGrid,
    footprint: Footprint,
    params: PlannerParams,
    start: Array,
    goal: Array,
    margin_m: float,
    slack_m: float,
) -> _Window:
    reach = footprint.circumscribed_m()
    low = np.minimum(start[:2], goal[:2]) - 1.5 * reach
    high = np.maximum(start[:2], goal[:2]) + 1.5 * reach
    columns, rows = (math.ceil(size / _STEP_M) for size in high - low)
    ys, xs = np.mgrid[0:rows, 0:columns]
    middles = np.column_stack((low[0] + (xs.ravel() + 0.5) * _STEP_M, low[1] + (ys.ravel() + 0.5) * _STEP_M))
    place = grid.resolution_m, grid.x_m, grid.y_m
    # A robot that stands nearer than the margin may leave, as it may arrive at a goal that is nearer.
    margins = np.full(len(middles), margin_m)
    for end, slack in ((start, slack_m), (goal, grid.resolution_m)):
        clear_m = float(grid.clearance_m(outline(footprint), end[None])[0]) - slack
        near = np.hypot(middles[:, 0] - end[0], middles[:, 1] - end[1]) <= params.escape_m
        margins[near] = np.minimum(margins[near], clear_m)
    easy_m = params.easy_margin_m + grid.half_cell_m
    radii_m = reach, footprint.inscribed_m()
    room = heading_room(grid.field, *place, outline(footprint), middles, params.heading_bins, margins, easy_m, *radii_m)
    point = np.zeros((1, 2))
    clear = clearances(grid.field, *place, point, np.column_stack((middles, np.zeros(len(middles)))), 0.0)
    # The cost rises up to the walls, so that a gate is passed in its middle.
    far_m = reach + params.prefer_m
    cost = 1.0 + params.near_cost * np.clip((far_m - clear) / far_m, 0.0, 1.0)
    if not params.unknown_is_passable:
        room[grid.values(grid.unknown, middles, True)] = CLOSED
    return _Window(
        float(low[0]),
        float(low[1]),
        room.reshape(rows, columns, -1),
        np.ascontiguousarray(cost.reshape(rows, columns)),
        _courses(grid, middles, (rows, columns)),
    )


def _courses(grid: PlanningGrid, points: Array, shape: tuple[int, int]) -> Courses:
    """The courses permitted at (n, 2) points, as (rows, columns)."""
    if not grid.courses.size:
        return FREE_COURSES
    return grid.values(grid.courses, points, ALL_COURSES).reshape(shape)


def _straightened(grid: PlanningGrid, edge: Array, poses: Array, margin_m: float, easy_m: float) -> Array:
    """Straight motions (turning evenly on the way) between as few of the poses as stay as clear.

    easy_m: more clearance than this is not kept.
    """
    kept = [poses[:1]]
    room_m = np.clip(grid.clearance_m(edge, poses), margin_m, easy_m)
    at = 0
    while at < len(poses) - 1:
        step, then = 1, at + 1
        while then < len(poses) - 1:
            step *= 2
            further = min(at + step, len(poses) - 1)
            if not _clear(grid, edge, poses[at], poses[further], float(room_m[at : further + 1].min())):
                break
            then = further
        kept.append(_line(poses[at], poses[then])[1:])
        at = then
    return np.concatenate(kept)


def _line(a: Array, b: Array) -> Array:
    """(n, 3) poses from a to b, both included; a turn on the spot keeps its steps."""
    size = max(math.hypot(b[0] - a[0], b[1] - a[1]) / _STEP_M, abs(b[2] - a[2]) / _STEP_RAD)
    share = np.linspace(0.0, 1.0, max(1, math.ceil(size)) + 1)[:, None]
    return np.asarray(a + share * (b - a))


def _clear(grid: PlanningGrid, edge: Array, a: Array, b: Array, margin_m: float) -> bool:
    if not line_permits(grid.courses, grid.resolution_m, grid.x_m, grid.y_m, a, b):
        return False
    return bool(np.all(grid.clearance_m(edge, _line(a, b)[1:-1]) >= margin_m))
