"""What is around the robot: the obstacle points of the last moments, and those it has come too near to see.

All of them are kept in the frame of the robot's own dead reckoning, so that a point is where it was in the world
however the robot has moved since the point's time. One cloud covers half of the surroundings when a driver sends half
sweeps: the points of ``window_s`` together are the whole picture.

A LiDAR on top of a robot does not see what is low and near. Such a point is remembered from when it was seen, by cells,
until its place is in view again and empty, or it is too old or too far behind to be trusted.
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
from robot_stack.safety.obstacle_params import BlindParams, ExclusionParams, ObstacleParams, VolumeParams
from robot_stack.safety.reckoning import DeadReckoning
from robot_stack.safety.timing import age_s

_NO_POINTS = np.empty((0, 3))
# Cells of a row of the memory's grid, more than anybody can drive.
_ROW = 2**31


@dataclass(frozen=True, slots=True)
class Cloud:
    """points: (n, 3) m in the dead-reckoning frame. at_s: steady time of the points."""

    points: Floats
    at_s: float


@dataclass(frozen=True, slots=True)
class Dock:
    """The dock's frame in the dead-reckoning frame, and when it was told, steady s."""

    pose: Pose2
    at_s: float


class Surroundings:
    """Feed it motion, clouds and the dock; ask for the points. Steady seconds."""

    def __init__(
        self, obstacles: ObstacleParams, reckoning: DeadReckoning, lidar_xyz_m: tuple[float, float, float]
    ) -> None:
        self._params = obstacles
        self._reckoning = reckoning
        self._memory = BlindSpot(obstacles.blind, lidar_xyz_m)
        self._clouds: deque[Cloud] = deque()
        self._at_s: float | None = None
        self._dock: Dock | None = None
        self.problem = "never received"

    def received(self, points: NDArray[Any], latency_s: float, outline: Outline, now_s: float) -> None:
        """A cloud: (n, 3) m in base_link at a moment ``latency_s`` ago. Points inside the body's outline are its own.

        A cloud that is late, from the future or without any finite point among its points counts as not received.
        """
        finite = points[np.isfinite(points).all(axis=1)]
        self.problem = self._problem(len(points), len(finite), latency_s)
        if self.problem:
            return
        moment_s = now_s - latency_s
        pose = self._reckoning.pose_at(moment_s)
        near = np.hypot(finite[:, 0], finite[:, 1]) <= self._params.radius_m
        seen = _thinned(np.asarray(finite[near & ~outline.contains(finite)], np.float64), self._params.column_m)
        self._at_s = now_s
        self._clouds.append(Cloud(_moved(seen, pose), moment_s))
        while not 0.0 <= moment_s - self._clouds[0].at_s <= self._params.window_s:
            self._clouds.popleft()
        self._memory.update(self._live(), len(seen), pose, outline, self._reckoning.way_m, now_s)

    def refused(self, problem: str) -> None:
        """A message that is no cloud of points."""
        self.problem = problem

    def dock(self, pose: Pose2, latency_s: float, now_s: float) -> None:
        """The frame of the dock, in base_link at a moment ``latency_s`` ago. Ignored if it is not finite or late."""
        if pose.is_finite() and 0.0 <= latency_s <= self._params.max_latency_s:
            self._dock = Dock(self._reckoning.pose_at(now_s - latency_s).compose(pose), now_s)

    def age_s(self, now_s: float) -> float:
        """Seconds since the newest usable cloud was received."""
        return age_s(now_s, self._at_s)

    def points(self, docking: bool, dock_stale_s: float, now_s: float) -> Floats:
        """(n, 3) m in base_link now: everything that is an obstacle.

        docking: the robot is on its last way to a dock, whose own parts are none.
        """
        known = np.concatenate([self._live(), self._memory.points(self._reckoning.way_m, now_s)])
        if docking and self._dock is not None and age_s(now_s, self._dock.at_s) <= dock_stale_s:
            known = known[~_of_dock(_seen_from(known, self._dock.pose), self._params.exclusion)]
        return _seen_from(known, self._reckoning.pose_at(now_s))

    def _live(self) -> Floats:
        return np.concatenate([cloud.points for cloud in self._clouds]) if self._clouds else _NO_POINTS

    def _problem(self, count: int, finite: int, latency_s: float) -> str:
        if not 0.0 <= latency_s <= self._params.max_latency_s:
            return f"its points are {latency_s:.2f} s old"
        return "no point is finite" if count and not finite else ""


class BlindSpot:
    """Cells in which something was seen that cannot be seen from where the robot is now."""

    def __init__(self, params: BlindParams, lidar_xyz_m: tuple[float, float, float]) -> None:
        self._params = params
        self._lidar_x_m, _, self._lidar_z_m = lidar_xyz_m
        self._slope = math.tan(math.radians(params.lowest_ray_deg))
        self._points = _NO_POINTS  # of each cell a point, at the height of its column's top
        self._seen_s = np.empty(0)
        self._seen_at_m = np.empty(0)
        self._sightings = np.empty(0)

    def update(self, live: Floats, new: int, pose: Pose2, outline: Outline, way_m: float, now_s: float) -> None:
        """What is in view now (dead-reckoning frame; the last ``new`` have just been seen), from ``pose``."""
        fresh = np.arange(len(live)) >= len(live) - new
        near = _near(live, pose, self._params.radius_m)
        here, count = live[near], int(near.sum())
        points = np.concatenate([here, self._points])
        if not len(points):
            return
        first, group = _columns(points, self._params.cell_m)
        # The height of a column is what is seen of it now; the memory's counts only where nothing is.
        tops = np.full(len(first), -math.inf)
        np.maximum.at(tops, group[:count], here[:, 2])
        unseen = np.isneginf(tops)
        tops[unseen] = points[first[unseen], 2]
        points = np.column_stack([points[first, :2], tops])
        seen_s, seen_at_m = np.full(len(first), now_s), np.full(len(first), way_m)
        old = group[count:]
        seen_s[old], seen_at_m[old] = (
            np.where(unseen[old], self._seen_s, now_s),
            np.where(unseen[old], self._seen_at_m, way_m),
        )
        sightings = np.zeros(len(first))
        sightings[old] = self._sightings
        sightings[np.unique(group[:count][fresh[near]])] += 1.0
        local = _seen_from(points, pose)
        keep = (~unseen | self._hidden(local)) & ~outline.contains(local) & _near(points, pose, self._params.radius_m)
        self._points, self._sightings = points[keep], sightings[keep]
        self._seen_s, self._seen_at_m = seen_s[keep], seen_at_m[keep]

    def points(self, way_m: float, now_s: float) -> Floats:
        """(n, 3) m: remembered points, the dead-reckoning frame."""
        age = now_s - self._seen_s
        trusted = (age >= 0.0) & (age <= self._params.memory_s) & (self._sightings >= self._params.sightings)
        return self._points[trusted & (way_m - self._seen_at_m <= self._params.memory_m)]

    def _hidden(self, local: Floats) -> NDArray[np.bool_]:
        """(n,) whose column's top, in base_link, is below the lowest ray."""
        range_m = np.hypot(local[:, 0] - self._lidar_x_m, local[:, 1])
        hidden: NDArray[np.bool_] = local[:, 2] <= self._lidar_z_m + self._slope * range_m + self._params.ray_margin_m
        return hidden


def _columns(points: Floats, cell_m: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(index of the first point of each upright column of cells, (n,) column of each point)."""
    cells = np.floor(points[:, :2] / cell_m).astype(np.int64)
    _, first, group = np.unique(cells[:, 0] * _ROW + cells[:, 1], return_index=True, return_inverse=True)
    return first, group


def _thinned(points: Floats, cell_m: float) -> Floats:
    """Of each column the point nearest to the robot, at the height of the column's highest: (m, 3).

    A motion in the plane meets a column as a whole, and what hides a point, or makes it part of a dock, is its height.
    """
    ordered = points[np.argsort(np.square(points[:, :2]).sum(axis=1), kind="stable")]
    first, group = _columns(ordered, cell_m)
    thin = ordered[first]
    np.maximum.at(thin[:, 2], group, ordered[:, 2])
    return thin


def _near(points: Floats, pose: Pose2, radius_m: float) -> NDArray[np.bool_]:
    near: NDArray[np.bool_] = np.hypot(points[:, 0] - pose.x, points[:, 1] - pose.y) <= radius_m
    return near


def _of_dock(points: Floats, exclusion: ExclusionParams) -> NDArray[np.bool_]:
    """(n,) which of the points, in the dock's frame, belong to it and whoever sits there."""
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


def _seen_from(points: Floats, pose: Pose2) -> Floats:
    """(n, 3) points in the frame ``pose``, given in its parent frame."""
    return _moved(points, pose.inverse())
