"""The rolling grid: marks and free space in odom, whatever way the robot goes."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import Footprint
from robot_stack.costmap import kernels
from robot_stack.costmap.kernels import UNKNOWN, Cells
from robot_stack.costmap.params import MarkingParams

NumberT = TypeVar("NumberT", bound=np.generic)


class RollingGrid:
    """What is known of the cells around the robot. Stamps in s; cells are aligned to whole cells of odom."""

    def __init__(
        self,
        size_m: float,
        resolution_m: float,
        directions: int,
        marking: MarkingParams,
        lidar_xyz_m: tuple[float, float, float],
    ) -> None:
        count = round(size_m / resolution_m)
        self._resolution_m = resolution_m
        self._corner = np.zeros(2, np.int64)
        self._nearest_m = np.full(directions, math.inf)
        slope = math.tan(math.radians(marking.lowest_ray_deg))
        self._lidar = np.array([lidar_xyz_m[0], lidar_xyz_m[2], slope, marking.ray_margin_m])
        self._lives = np.array([marking.clear_after_s, marking.in_view_s, marking.out_of_view_s, marking.steady_s])
        self.state: Cells = np.full((count, count), UNKNOWN, np.int8)
        self._since_s = np.full((count, count), -math.inf)
        self._seen_s = np.full((count, count), -math.inf)
        self._top_m = np.zeros((count, count), np.float32)

    @property
    def corner_m(self) -> tuple[float, float]:
        """Lower left corner in odom, m."""
        return float(self._corner[0] * self._resolution_m), float(self._corner[1] * self._resolution_m)

    def forget(self) -> None:
        """Nothing is known any more."""
        self.state[:] = UNKNOWN
        self._nearest_m[:] = math.inf

    def centre_on(self, pose: Pose2) -> None:
        """Rolls so that ``pose`` is in the middle. What leaves the grid is forgotten, what enters it is unknown."""
        half = len(self.state) // 2
        corner = np.array(
            [math.floor(pose.x / self._resolution_m) - half, math.floor(pose.y / self._resolution_m) - half], np.int64
        )
        columns, rows = corner - self._corner
        self._corner = corner
        if rows or columns:
            self.state = _rolled(self.state, int(rows), int(columns), float(UNKNOWN))
            self._since_s = _rolled(self._since_s, int(rows), int(columns), -math.inf)
            self._seen_s = _rolled(self._seen_s, int(rows), int(columns), -math.inf)
            self._top_m = _rolled(self._top_m, int(rows), int(columns), 0.0)

    def mark(self, points: NDArray[np.float32], pose: Pose2, stamp_s: float) -> None:
        """Obstacle points, (n, 3) m in base_link, which was at ``pose``."""
        kernels.mark(
            self.state,
            self._since_s,
            self._seen_s,
            self._top_m,
            self._nearest_m,
            np.ascontiguousarray(points, np.float32),
            _array(pose),
            self._corner,
            self._resolution_m,
            stamp_s,
        )

    def clear(self, free_m: NDArray[np.float64], pose: Pose2, footprint: Footprint, stamp_s: float) -> None:
        """Rays around base_link at ``pose``. free_m: (directions,) how far ground was seen free, 0 where it was not;
        direction i is -pi + (i + 0.5) * 2 pi / directions. They end at the obstacles marked last."""
        kernels.clear(
            self.state,
            self._since_s,
            self._seen_s,
            self._top_m,
            self._nearest_m,
            free_m,
            _array(pose),
            self._corner,
            self._resolution_m,
            np.array([footprint.rear_m, footprint.front_m, 0.5 * footprint.width_m]),
            self._lidar,
            self._lives,
            stamp_s,
        )


def _array(pose: Pose2) -> NDArray[np.float64]:
    return np.array([pose.x, pose.y, pose.yaw])


def _rolled(cells: NDArray[NumberT], rows: int, columns: int, fill: float) -> NDArray[NumberT]:
    """The cells of a window that has moved by that many rows and columns."""
    out = np.full_like(cells, fill)
    height, width = cells.shape
    if abs(rows) >= height or abs(columns) >= width:
        return out
    out[max(-rows, 0) : height - max(rows, 0), max(-columns, 0) : width - max(columns, 0)] = cells[
        max(rows, 0) : height - max(-rows, 0), max(columns, 0) : width - max(-columns, 0)
    ]
    return out
