"""A costmap, the clouds of a place in the world as a robot at a pose sees it, and a picture of both."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.config import load
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2
from robot_stack.core.robot import load_robot
from robot_stack.costmap.costmap import Costs, FreeSpace, LocalCostmap
from robot_stack.costmap.params import CostmapParams

ROBOT = load_robot()
PARAMS = load(CostmapParams, "costmap_server")
DIRECTIONS = 720
SEES_M = 6.0


def box(x0: float, x1: float, y0: float, y1: float, top_m: float = 1.0) -> NDArray[np.float64]:
    """(n, 3) points on the faces of a box, 4 cm apart, m, odom."""
    xs, ys = (np.arange(low, high + 1e-9, 0.04) for low, high in ((x0, x1), (y0, y1)))
    rim = np.concatenate(
        [
            [(x, y) for x in xs for y in (y0, y1)],
            [(x, y) for x in (x0, x1) for y in ys],
        ]
    )
    heights = np.arange(0.15, top_m + 1e-9, 0.1)
    return np.concatenate([np.column_stack([rim, np.full(len(rim), z)]) for z in [*heights, top_m]])


class Place:
    """Shows a costmap what stands in the world, cloud by cloud, 20 Hz."""

    def __init__(self, *things: NDArray[np.float64]) -> None:
        self.costmap = LocalCostmap(PARAMS, ROBOT)
        self.things = list(things)
        self.pose = IDENTITY
        self.twist = ZERO_TWIST
        self.now_s = 100.0
        self.ground_seen = True

    def look(self, seconds: float = 0.05) -> Place:
        for _ in range(max(1, round(seconds / 0.05))):
            self.now_s += 0.05
            assert self.costmap.on_odometry(self.now_s, self.pose, self.twist) == ""
            everything = self._from_robot()
            nearest = self._nearest(everything)
            seen = np.hypot(everything[:, 0], everything[:, 1]) <= nearest[_bearings(everything)] + 0.2
            assert self.costmap.on_obstacles(self.now_s, everything[seen]) == ""
            if self.ground_seen:
                assert self.costmap.on_free_space(self._free(nearest)) == ""
        return self

    def _from_robot(self) -> NDArray[np.float32]:
        """(n, 3) m, base_link: all points there are."""
        world = np.concatenate([np.empty((0, 3)), *self.things])
        c, s = math.cos(self.pose.yaw), math.sin(self.pose.yaw)
        dx, dy = world[:, 0] - self.pose.x, world[:, 1] - self.pose.y
        return np.column_stack([c * dx + s * dy, -s * dx + c * dy, world[:, 2]]).astype(np.float32)

    def _free(self, nearest: NDArray[np.float64]) -> FreeSpace:
        step = 2.0 * math.pi / DIRECTIONS
        ranges = np.minimum(nearest, SEES_M).astype(np.float32)
        return FreeSpace(ranges, -math.pi + 0.5 * step, step, self.now_s)

    def at(self, x_m: float, y_m: float) -> int:
        """The cost of the cell at a place in odom."""
        return value_at(self.costmap.costs(), x_m, y_m)

    def _nearest(self, points: NDArray[np.float32]) -> NDArray[np.float64]:
        nearest = np.full(DIRECTIONS, np.inf)
        # A point hides what is behind it a little to both sides, so that a face of points has no gaps.
        bearings, ranges = _bearings(points), np.hypot(points[:, 0], points[:, 1])
        for beside in (-2, -1, 0, 1, 2):
            np.minimum.at(nearest, (bearings + beside) % DIRECTIONS, ranges)
        return nearest


def _bearings(points: NDArray[np.float32]) -> NDArray[np.int64]:
    turn = (np.arctan2(points[:, 1], points[:, 0]) + math.pi) / (2.0 * math.pi)
    return (turn * DIRECTIONS).astype(np.int64) % DIRECTIONS


def value_at(costs: Costs, x_m: float, y_m: float) -> int:
    column = math.floor((x_m - costs.corner_m[0]) / costs.resolution_m + 1e-6)
    row = math.floor((y_m - costs.corner_m[1]) / costs.resolution_m + 1e-6)
    return int(costs.values[row, column])


def picture(costs: Costs, robot: Pose2, file: Path) -> None:
    """The costs as Nav2's colours show them in RViz, roughly: unknown grey, free white, inflated blue to red."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    size = costs.values.shape[0] * costs.resolution_m
    x, y = costs.corner_m
    shown = np.ma.masked_less(costs.values.astype(float), 0.0)
    figure, axes = pyplot.subplots(figsize=(7, 7))
    axes.set_facecolor("0.7")
    axes.imshow(shown, origin="lower", cmap="YlOrRd", vmin=0, vmax=100, extent=(x, x + size, y, y + size))
    corners = [
        robot.compose(Pose2(px, py, 0.0))
        for px, py in ((0.5, 0.35), (0.5, -0.35), (-0.5, -0.35), (-0.5, 0.35), (0.5, 0.35))
    ]
    axes.plot([p.x for p in corners], [p.y for p in corners], "b-")
    axes.set_xlabel("x in odom, m")
    axes.set_ylabel("y in odom, m")
    figure.savefig(file, dpi=80)
    pyplot.close(figure)
