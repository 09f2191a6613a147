"""The robot's surroundings: the obstacle points of the last moments, and the end of perception's known space.

All of them are stored in the dead-reckoning frame, so that a point keeps its place in the world while the robot
moves. One cloud may cover half of the surroundings: the points of ``window_s`` together cover all of them. Perception
remembers points that were seen before and are hidden now.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import Pose2
from robot_stack.safety.collision import Floats, Outline
from robot_stack.safety.dead_reckoning import DeadReckoning
from robot_stack.safety.obstacle_params import ExclusionParams, ObstacleParams, VolumeParams
from robot_stack.safety.timing import age_s

_NO_POINTS = np.empty((0, 3))


@dataclass(frozen=True, slots=True)
class Cloud:
    """points: (n, 3+) m in the dead-reckoning frame. at_s: steady time of the points."""

    points: Floats
    at_s: float


@dataclass(frozen=True, slots=True)
class Dock:
    """The dock's frame in the dead-reckoning frame, and its time of reception, steady s."""

    pose: Pose2
    at_s: float


class Surroundings:
    """Stores clouds and the dock; returns the points now. Steady seconds."""

    def __init__(self, obstacles: ObstacleParams, dead_reckoning: DeadReckoning) -> None:
        self._params = obstacles
        self._dead_reckoning = dead_reckoning
        self._clouds: deque[Cloud] = deque()
        self._live = _NO_POINTS  # points of all clouds
        self._at_s: float | None = None
        self._unseen: Cloud | None = None
        self._no_ground: Cloud | None = None
        self._moving: Cloud | None = None  # with the velocities, as of when it was received
        self._dock: Dock | None = None
        self.problem = "never received"

    def received(self, points: NDArray[Any], latency_s: float, outline: Outline, now_s: float) -> None:
        """A cloud: (n, 3) m in base_link at a moment ``latency_s`` ago. Points inside the outline are the robot's own.

        A cloud that is late, from the future, or has points but no finite one counts as not received.
        """
        x, y = points[:, 0], points[:, 1]
        finite = np.isfinite(x + y + points[:, 2])
        self.problem = self._problem(len(points), int(np.count_nonzero(finite)), latency_s)
        if self.problem:
            return
        moment_s = now_s - latency_s
        pose = self._dead_reckoning.pose_at(moment_s)
        near = np.asarray(points[finite & (x * x + y * y <= self._params.radius_m**2)], np.float64)
        seen = _thinned(near[~outline.contains(near)], self._params.column_m)
        self._at_s = now_s
        self._clouds.append(Cloud(_moved(seen, pose), moment_s))
        while not 0.0 <= moment_s - self._clouds[0].at_s <= self._params.window_s:
            self._clouds.popleft()
        self._live = np.concatenate([cloud.points for cloud in self._clouds])

    def unseen_received(self, points: NDArray[Any], latency_s: float, now_s: float) -> None:
        """Where known space ended ``latency_s`` ago: (n, 3) m in base_link. Unusable points count as not received."""
        self._unseen = self._ends(points, latency_s, now_s) or self._unseen

    def unseen(self, stale_s: float, now_s: float) -> Floats | None:
        """(n, 3) m in base_link now: where known space ends; None without such points for longer than ``stale_s``."""
        return self._now(self._unseen, stale_s, now_s)

    def no_ground_received(self, points: NDArray[Any], latency_s: float, now_s: float) -> None:
        """Where known ground ended ``latency_s`` ago: (n, 3) m in base_link. Unusable points count as not received."""
        self._no_ground = self._ends(points, latency_s, now_s) or self._no_ground

    def no_ground(self, stale_s: float, now_s: float) -> Floats | None:
        """(n, 3) m in base_link now: where known ground ends; None without such points for longer than ``stale_s``."""
        return self._now(self._no_ground, stale_s, now_s)

    def moving_received(self, points: NDArray[Any], latency_s: float, now_s: float) -> None:
        """Bodies that moved ``latency_s`` ago: (n, 5) x, y, z, vx, vy in base_link. Unusable ones are ignored."""
        finite = np.isfinite(points).all(axis=1)
        if self._problem(len(points), int(finite.sum()), latency_s):
            return
        pose, rows = self._dead_reckoning.pose_at(now_s - latency_s), np.asarray(points[finite], np.float64)
        self._moving = Cloud(_set_in_motion(rows, pose, latency_s), now_s)

    def moving(self, stale_s: float, now_s: float) -> Floats | None:
        """(n, 5) in base_link now: moving bodies, extrapolated by their velocity; None without fresh ones."""
        known = self._moving
        if known is None or not age_s(now_s, known.at_s) <= stale_s:
            return None
        return _set_in_motion(known.points, self._dead_reckoning.pose_at(now_s).inverse(), age_s(now_s, known.at_s))

    def refused(self, problem: str) -> None:
        """Handles a message that is no valid cloud."""
        self.problem = problem

    def dock(self, pose: Pose2, latency_s: float, now_s: float) -> None:
        """The frame of the dock, in base_link at a moment ``latency_s`` ago. Ignored if it is not finite or late."""
        if pose.is_finite() and 0.0 <= latency_s <= self._params.max_latency_s:
            self._dock = Dock(self._dead_reckoning.pose_at(now_s - latency_s).compose(pose), now_s)

    @property
    def known(self) -> bool:
        """True after the first usable cloud."""
        return self._at_s is not None

    def age_s(self, now_s: float) -> float:
        """Seconds since the newest usable cloud was received."""
        return age_s(now_s, self._at_s)

    def sight_age_s(self, now_s: float) -> float:
        """Age of the points of the newest usable cloud, s: their latency included."""
        return age_s(now_s, self._clouds[-1].at_s if self._clouds else None)

    def points(self, docking: bool, dock_stale_s: float, now_s: float) -> Floats:
        """(n, 3) m in base_link now: all obstacle points.

        docking: the robot moves into a dock, whose own parts are no obstacles.
        """
        known = self._live
        if docking and self._dock is not None and age_s(now_s, self._dock.at_s) <= dock_stale_s:
            known = known[~_of_dock(_seen_from(known, self._dock.pose), self._params.exclusion)]
        return _seen_from(known, self._dead_reckoning.pose_at(now_s))

    def _ends(self, points: NDArray[Any], latency_s: float, now_s: float) -> Cloud | None:
        """Points of ``latency_s`` ago in the dead-reckoning frame, received now; None if unusable."""
        finite = points[np.isfinite(points).all(axis=1)]
        if self._problem(len(points), len(finite), latency_s):
            return None
        pose = self._dead_reckoning.pose_at(now_s - latency_s)
        return Cloud(_moved(np.asarray(finite, np.float64), pose), now_s)

    def _now(self, cloud: Cloud | None, stale_s: float, now_s: float) -> Floats | None:
        if cloud is None or not age_s(now_s, cloud.at_s) <= stale_s:
            return None
        return _seen_from(cloud.points, self._dead_reckoning.pose_at(now_s))

    def _problem(self, count: int, finite: int, latency_s: float) -> str:
        if not 0.0 <= latency_s <= self._params.max_latency_s:
            return f"its points are {latency_s:.2f} s old"
        return "no point is finite" if count and not finite else ""


def _cells(points: Floats, cell_m: float) -> NDArray[np.int64]:
    """(n,) number of the upright column of cells of each point (at least one), rising with x, then with y."""
    column, row = np.floor(points[:, :2].T / cell_m).astype(np.int64)
    row -= row.min()
    numbers: NDArray[np.int64] = (column - column.min()) * (row.max() + 1) + row
    return numbers


def _columns(points: Floats, cell_m: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(index of the first point of each upright column of cells, (n,) column of each point), for at least one."""
    # Sorted with their index in the low bits: numpy sorts plain numbers many times faster than it finds an order.
    bits = len(points).bit_length()
    packed = np.sort((_cells(points, cell_m) << bits) | np.arange(len(points)))
    order, cells = packed & ((1 << bits) - 1), packed >> bits
    begins = np.concatenate([[True], cells[1:] != cells[:-1]])
    group = np.empty(len(points), np.int64)
    group[order] = np.cumsum(begins) - 1
    return order[begins], group


def _thinned(points: Floats, cell_m: float) -> Floats:
    """For each column the point nearest to the robot, at the height of the column's highest: (m, 3).

    Planar motion hits a column as a whole; the height decides whether it is hidden or part of a dock.
    """
    if not len(points):
        return points
    first, group = _columns(points, cell_m)
    x, y, z = points.T
    square = x * x + y * y
    nearest, top = np.full(len(first), math.inf), np.full(len(first), -math.inf)
    np.minimum.at(nearest, group, square)
    np.maximum.at(top, group, z)
    found = np.flatnonzero(square == nearest[group])[::-1]  # of several at the same distance the first one
    first[group[found]] = found
    return np.column_stack([points[first, :2], top])


def _of_dock(points: Floats, exclusion: ExclusionParams) -> NDArray[np.bool_]:
    """(n,) True for points, in the dock's frame, of the dock and a person seated there."""
    return _within(points, exclusion.body) | _within(points, exclusion.rails)


def _within(points: Floats, volume: VolumeParams) -> NDArray[np.bool_]:
    x, y = points[:, 0], np.abs(points[:, 1])
    along = (x >= volume.rear_m) & (x <= volume.front_m)
    within: NDArray[np.bool_] = along & (y >= volume.inner_m) & (y <= volume.outer_m) & (points[:, 2] <= volume.top_m)
    return within


def _moved(points: Floats, pose: Pose2) -> Floats:
    """(n, 3) points given in the frame ``pose``, in its parent frame."""
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    x, y = points[:, 0], points[:, 1]
    return np.column_stack([pose.x + c * x - s * y, pose.y + s * x + c * y, points[:, 2]])


def _set_in_motion(rows: Floats, pose: Pose2, after_s: float) -> Floats:
    """(n, 5) places and velocities given in the frame ``pose``, in its parent frame, some time later."""
    turn = Pose2(0.0, 0.0, pose.yaw)
    velocity = _moved(np.column_stack([rows[:, 3:], np.zeros(len(rows))]), turn)
    places = _moved(rows[:, :3], pose)
    places[:, :2] += after_s * velocity[:, :2]
    return np.column_stack([places, velocity[:, :2]])


def _seen_from(points: Floats, pose: Pose2) -> Floats:
    """(n, 3) points in the frame ``pose``, given in its parent frame."""
    return _moved(points, pose.inverse())
