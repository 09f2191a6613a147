"""The local costmap: odometry, obstacle points and free space in, a grid of costs out. Stamps in s, one clock."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2
from robot_stack.core.robot import Robot
from robot_stack.costmap import kernels
from robot_stack.costmap.grid import RollingGrid
from robot_stack.costmap.inflation import cost_table
from robot_stack.costmap.kernels import Cells
from robot_stack.costmap.params import CostmapParams
from robot_stack.costmap.poses import Poses


@dataclass(frozen=True, slots=True)
class Costs:
    """values: (rows, columns) as in an OccupancyGrid, row 0 at the lowest y. corner_m: lower left, odom.
    stamp_s: of the newest obstacles in it."""

    values: Cells
    corner_m: tuple[float, float]
    resolution_m: float
    stamp_s: float


@dataclass(frozen=True, slots=True)
class FreeSpace:
    """ranges_m: how far ground was seen free, 0 or not finite where it was not; range i lies in the direction
    angle_min_rad + i * step_rad of base_link."""

    ranges_m: NDArray[np.float32]
    angle_min_rad: float
    step_rad: float
    stamp_s: float


class LocalCostmap:
    """Feed it everything in the order of arrival; ask for ``costs`` when an obstacle cloud was taken."""

    def __init__(self, params: CostmapParams, robot: Robot) -> None:
        self._params = params
        footprints = {False: robot.footprint, True: robot.footprint_with_chair}
        self._footprints = footprints
        self._tables = {
            chair: cost_table(footprint, params.inflation.beyond_m, params.inflation.scaling_per_m, params.resolution_m)
            for chair, footprint in footprints.items()
        }
        self._grid = RollingGrid(
            params.size_m, params.resolution_m, params.directions, params.marking, robot.lidar_xyz_m
        )
        self._poses = Poses(params.odometry)
        self._nothing = np.zeros(params.directions)
        self._stamp_s = -math.inf
        self.chair = False

    def on_odometry(self, stamp_s: float, pose: Pose2, twist: Twist2) -> str:
        """base_link in odom. Returns why it cannot be used, empty if it can."""
        if not (pose.is_finite() and twist.is_finite()):
            return "odometry is not finite"
        if not self._poses.add(stamp_s, pose, twist):
            self._grid.forget()
            self._stamp_s = -math.inf
        return ""

    def on_obstacles(self, stamp_s: float, points: NDArray[np.float32]) -> str:
        """(n, 3) m in base_link at the stamp. Returns why they cannot be used, empty if they can."""
        pose = self._poses.at(stamp_s)
        if pose is None:
            return "no odometry at the stamp of the obstacles"
        self._stamp_s = stamp_s
        self._grid.centre_on(pose)
        self._grid.mark(points, pose, stamp_s)
        self._clear(self._nothing, pose, stamp_s)
        return ""

    def on_free_space(self, free: FreeSpace) -> str:
        """Returns why it cannot be used, empty if it can. Its obstacles may come before or after it."""
        turn = abs(free.step_rad) * len(free.ranges_m)
        if not (math.isfinite(free.angle_min_rad) and abs(turn - 2.0 * math.pi) < abs(free.step_rad)):
            return f"free space does not go once around: {math.degrees(turn):.0f} deg"
        pose = self._poses.at(free.stamp_s)
        if pose is None:
            return "no odometry at the stamp of the free space"
        self._clear(_by_direction(free, self._params.directions), pose, free.stamp_s)
        return ""

    def costs(self) -> Costs:
        """Everything known by the newest obstacles, inflated by the footprint in force."""
        values = np.empty_like(self._grid.state)
        kernels.inflate(self._grid.state, self._tables[self.chair], values)
        return Costs(values, self._grid.corner_m, self._params.resolution_m, self._stamp_s)

    def warm_up(self) -> None:
        """Compiles, or loads from disk, what the first cloud would otherwise wait for."""
        other = LocalCostmap.__new__(LocalCostmap)
        other.__dict__.update(self.__dict__)
        p = self._params
        other._grid = RollingGrid(p.size_m, p.resolution_m, p.directions, p.marking, (0.0, 0.0, 1.0))
        other._poses = Poses(p.odometry)
        other.on_odometry(0.0, IDENTITY, ZERO_TWIST)
        other.on_obstacles(0.0, np.ones((1, 3), np.float32))
        other.costs()

    def _clear(self, free_m: NDArray[np.float64], pose: Pose2, stamp_s: float) -> None:
        self._grid.clear(free_m, pose, self._footprints[self.chair], stamp_s)


def _by_direction(free: FreeSpace, directions: int) -> NDArray[np.float64]:
    """(directions,) m: the range whose direction is nearest to each of ours, which begin at -pi."""
    ours = -math.pi + (np.arange(directions) + 0.5) * (2.0 * math.pi / directions)
    index = np.round((ours - free.angle_min_rad) / free.step_rad).astype(np.int64) % len(free.ranges_m)
    ranges = free.ranges_m[index].astype(np.float64)
    return np.where(np.isfinite(ranges), ranges, 0.0)
