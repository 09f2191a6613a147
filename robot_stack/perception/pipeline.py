"""From a sweep to obstacles and free space: the stages in their order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import Pose2
from robot_stack.core.point_cloud import SWEEP, Points
from robot_stack.core.robot import Robot
from robot_stack.perception import cells, ground
from robot_stack.perception.crop import boxes, crop
from robot_stack.perception.deskew import LEVEL, Attitude, Motion, deskew
from robot_stack.perception.free_space import free_ranges
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.polar import make_grid, sort_points
from robot_stack.perception.voxel import voxels, without_strays

Float = NDArray[np.float32]
_WARM_COLUMNS = 360
_BLIND_POINTS = 3  # that stand for one blind direction


@dataclass(frozen=True, slots=True)
class Segmented:
    """xyz: (n, 3) base_link; labels: (n,) of ``cells``; height_m: (n,) above the local ground."""

    xyz: Float
    labels: NDArray[np.uint8]
    height_m: Float
    profile: ground.Profile


@dataclass(frozen=True, slots=True)
class Scene:
    """Obstacle points (n, 3) in base_link at stamp_s, and free ranges (directions,) of what this sweep itself saw."""

    stamp_s: float
    obstacles: Float
    free_m: Float
    broken: int


class Pipeline:
    """Everything but the inputs' health. Needs the motion to be known at the stamps it is given."""

    def __init__(self, robot: Robot, params: PerceptionParams) -> None:
        self._robot, self._params = robot, params
        self.motion = Motion(params.deskew)
        self._grid = make_grid(params.ground)
        self._mount = np.array(robot.lidar_xyz_m, dtype=np.float32)
        self._blind = {chair: self._outline(chair) for chair in (False, True)}
        self._cut = {chair: boxes(robot, params.crop, chair) for chair in (False, True)}
        self._range_m = (params.crop.range_min_m, params.crop.range_max_m)
        self._last: tuple[float, Float, NDArray[np.bool_]] | None = None
        self.chair = False

    def warm_up(self) -> None:
        """Compiles every kernel, or loads it from the cache."""
        points = np.zeros(_WARM_COLUMNS, SWEEP)
        angles = np.linspace(-np.pi, np.pi, _WARM_COLUMNS)
        points["x"], points["y"], points["z"] = 2.0 * np.cos(angles), 2.0 * np.sin(angles), 0.0
        points["time"] = np.linspace(-0.05, 0.0, _WARM_COLUMNS)
        self.scene(points, 0.0)
        self.forget()

    def forget(self) -> None:
        """Nothing was seen before the next sweep."""
        self._last = None

    def scene(self, points: Points, stamp_s: float, dark: NDArray[np.bool_] | None = None) -> Scene:
        """What the points show; obstacles of the sweep before are kept where this one did not look.

        dark: (sectors,) blind directions of the ``Watch``: an obstacle stands there, close to the robot.
        """
        xyz, broken = self.points(points, stamp_s)
        seen = self.segment(xyz, self.motion.attitude_at(stamp_s))
        obstacles = seen.xyz[(seen.labels == cells.OBSTACLE) | (seen.labels == cells.KERB)]
        params = self._params.obstacles
        obstacles = without_strays(obstacles, params.range_m, params.neighbourhood_m, params.neighbours_min)
        nowhere = np.zeros(self._params.watch.sectors, np.bool_)
        unseen = self._blind[self.chair][nowhere if dark is None else dark]
        obstacles = np.concatenate([obstacles, self._edges(seen.profile), unseen.reshape(-1, 3)])
        sensor = (float(self._mount[0]), float(self._mount[1]))
        free_m = free_ranges(seen.profile.free_m, sensor, obstacles, self._params.free_space.directions)
        fresh = voxels(obstacles, params.voxel_m)
        return Scene(stamp_s, self._with_other_half(fresh, seen.profile, stamp_s), free_m, broken)

    def points(self, points: Points, stamp_s: float) -> tuple[Float, int]:
        """Cropped and de-skewed: (n, 3) base_link at the stamp, and how many points were not finite."""
        xyz, times, broken = crop(points, self._mount, self._cut[self.chair], self._range_m)
        oldest_s = max(float(times.min()), -self._params.deskew.longest_s) if len(times) else 0.0
        steps = self.motion.steps(stamp_s, oldest_s)
        return deskew(xyz, times, steps, self._params.deskew.step_s), broken

    def segment(self, xyz: Float, attitude: Attitude | None = None) -> Segmented:
        """Ground and the rest. xyz: (n, 3) base_link; attitude None: the robot's own plane is taken for level."""
        params, level = self._params.ground, (attitude or LEVEL).matrix()
        x, y, z = (float(value) for value in level @ self._mount)
        points = sort_points(xyz, level.astype(np.float32), (x, y), self._grid, params.low_band_m, params.outlier_gap_m)
        start = ground.seeds(self._robot, level, (x, y), self._grid)
        profile = ground.follow(points, self._grid, start, z, params, self._params.free_space)
        labels, height = ground.classify(points, profile, z, params)
        return Segmented(xyz, labels, height, profile)

    def _outline(self, chair: bool) -> Float:
        """(sectors, k, 3) points just outside the footprint in force, in each direction of the ``Watch``, m."""
        footprint = self._robot.footprint_with_chair if chair else self._robot.footprint
        gap, sectors = self._params.watch.blind_gap_m, self._params.watch.sectors
        angles = (np.arange(sectors * _BLIND_POINTS) + 0.5) * (2.0 * np.pi / (sectors * _BLIND_POINTS)) - np.pi
        c, s = np.cos(angles), np.sin(angles)
        half = 0.5 * footprint.width_m + gap
        to_x = np.where(c > 0.0, footprint.front_m + gap - self._mount[0], self._mount[0] - footprint.rear_m + gap)
        to_y = np.where(s > 0.0, half - self._mount[1], half + self._mount[1])
        away = np.minimum(to_x / np.maximum(np.abs(c), 1e-9), to_y / np.maximum(np.abs(s), 1e-9))
        z = np.full_like(away, self._mount[2])
        xyz = np.stack([self._mount[0] + away * c, self._mount[1] + away * s, z], axis=1)
        return xyz.astype(np.float32).reshape(sectors, _BLIND_POINTS, 3)

    def _edges(self, profile: ground.Profile) -> Float:
        """(k, 3) points on the edges of drop-offs, as high above the ground as the lowest obstacle."""
        found = np.flatnonzero(profile.drop_m > 0.0)
        angles = (found + 0.5) * (2.0 * np.pi / self._grid.sectors) - np.pi
        away, z = profile.drop_m[found], profile.drop_height_m[found] + self._params.ground.obstacle_min_m
        xyz = np.stack([self._mount[0] + away * np.cos(angles), self._mount[1] + away * np.sin(angles), z], axis=1)
        return xyz.astype(np.float32)

    def _with_other_half(self, fresh: Float, profile: ground.Profile, stamp_s: float) -> Float:
        covered = (profile.kind != cells.EMPTY).any(axis=1)
        last, self._last = self._last, (stamp_s, fresh, covered)
        if last is None or not 0.0 < stamp_s - last[0] <= self._params.output.keep_s:
            return fresh
        step = self.motion.pose_at(last[0]).relative_to(self.motion.pose_at(stamp_s))
        moved = shifted(last[1], step)
        sector = sectors_of(moved, self._mount, self._grid.sectors)
        return np.concatenate([fresh, moved[~covered[sector]]])


def shifted(xyz: Float, step: Pose2) -> Float:
    """(n, 3) of a frame at ``step``, in the frame ``step`` is given in."""
    c, s = np.cos(step.yaw), np.sin(step.yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    moved: Float = (xyz @ turn.T + np.array([step.x, step.y, 0.0])).astype(np.float32)
    return moved


def sectors_of(xyz: Float, origin: NDArray[Any], sectors: int) -> NDArray[np.int64]:
    """(n,) the sector around ``origin`` in which each point lies."""
    angles = np.arctan2(xyz[:, 1] - origin[1], xyz[:, 0] - origin[0])
    found: NDArray[np.int64] = ((angles + np.pi) * (sectors / (2.0 * np.pi))).astype(np.int64)
    return np.minimum(found, sectors - 1)
