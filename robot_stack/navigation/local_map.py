"""The local costmap as the controller uses it: distances to lethal cells, in the costmap's frame.

Inflation assumes a circular robot; here the oriented footprint is checked against lethal cells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robot_stack.core.distance_field import clearance_field
from robot_stack.core.geometry import Pose2
from robot_stack.navigation.grid_kernels import Singles
from robot_stack.navigation.rollout_kernels import along_poses

Array = npt.NDArray[np.float64]
LETHAL = 100
# Largest distance computed.
_FAR_M = 2.0


@dataclass(frozen=True, slots=True)
class LocalMap:
    """stamp_s: ROS time. x_m, y_m: corner of cell (0, 0). cells: (rows, columns) int8 with Nav2's costs.

    seen: (rows, columns) static lethal cells. field: (rows, columns) metres to the nearest of these, or of the cells
    that site map and zones close.
    """

    stamp_s: float
    resolution_m: float
    x_m: float
    y_m: float
    cells: npt.NDArray[np.int8]
    seen: npt.NDArray[np.bool_]
    field: Singles

    def clearance_m(self, outline: Array, poses: Array) -> Array:
        """(n,) clearance of an outline at (n, 3) poses in the costmap's frame; 10 outside the costmap."""
        return along_poses(self.field, self.resolution_m, self.x_m, self.y_m, outline, poses)

    def leaving(self, outline: Array, pose: Array, margin_m: float, slack_m: float) -> tuple[Singles, float]:
        """(field, margin) for motions from ``pose`` (3,), where the robot may stand nearer than ``margin_m``.

        It may move away from what is nearer, or approach it by ``slack_m``. Cells that the outline touches, and
        those within ``margin_m`` of them, are not in the field: they would leave no margin to any other obstacle.
        """
        field, here_m = self.field, float(self.clearance_m(outline, pose[None])[0])
        if here_m <= 0.0:
            c, s = math.cos(pose[2]), math.sin(pose[2])
            x = pose[0] + c * outline[:, 0] - s * outline[:, 1] - self.x_m
            y = pose[1] + s * outline[:, 0] + c * outline[:, 1] - self.y_m
            rows, columns = np.floor(np.array((y, x)) / self.resolution_m).astype(np.int64)
            on = (rows >= 0) & (rows < field.shape[0]) & (columns >= 0) & (columns < field.shape[1])
            touched = np.zeros(field.shape, np.bool_)
            touched[rows[on], columns[on]] = field[rows[on], columns[on]] == 0.0
            others = (field == 0.0) & (clearance_field(touched, self.resolution_m, _FAR_M) > margin_m)
            field = clearance_field(others, self.resolution_m, _FAR_M)
            place = self.resolution_m, self.x_m, self.y_m
            here_m = float(along_poses(field, *place, outline, pose[None])[0])
        return field, min(margin_m, here_m - slack_m)

    def points(self) -> Array:
        """(n, 2) centres of static lethal cells, costmap's frame."""
        rows, columns = np.nonzero(self.seen)
        return np.column_stack(
            (self.x_m + (columns + 0.5) * self.resolution_m, self.y_m + (rows + 0.5) * self.resolution_m)
        )

    def covers(self, x: Array, y: Array) -> npt.NDArray[np.bool_]:
        """(n,) True for points (costmap's frame) inside the costmap and not unknown."""
        rows = np.floor((y - self.y_m) / self.resolution_m).astype(np.int64)
        columns = np.floor((x - self.x_m) / self.resolution_m).astype(np.int64)
        inside = (rows >= 0) & (columns >= 0) & (rows < self.cells.shape[0]) & (columns < self.cells.shape[1])
        known = np.zeros(len(x), np.bool_)
        known[inside] = self.cells[rows[inside], columns[inside]] >= 0
        return known


def costmap_problem(resolution_m: float, origin: Pose2, size: tuple[int, int], count: int) -> str:
    """Why a costmap is refused, naming the field; else an empty text. size: (rows, columns)."""
    if not (math.isfinite(resolution_m) and 0.0 < resolution_m <= 1.0):
        return f"/local_costmap/costmap info.resolution is {resolution_m}, must be in (0, 1] m"
    if not origin.is_finite():
        return f"/local_costmap/costmap info.origin is not finite: {origin}"
    if abs(origin.yaw) > 1e-3:
        return f"/local_costmap/costmap info.origin is turned by {origin.yaw:.3f} rad, must be 0"
    if size[0] < 1 or size[1] < 1 or size[0] * size[1] != count:
        return f"/local_costmap/costmap data has {count} cells, must be {size[0]} x {size[1]}"
    return ""


def local_map(
    stamp_s: float,
    resolution_m: float,
    origin: Pose2,
    cells: npt.NDArray[np.int8],
    moving: npt.NDArray[np.bool_],
    closed: npt.NDArray[np.bool_] | None = None,
) -> LocalMap:
    """moving: (rows, columns) lethal cells of pedestrians, whose predicted positions are avoided instead.

    closed: (rows, columns) cells that site map and zones close, avoided like static obstacles.
    """
    seen = (cells >= LETHAL) & ~moving
    field = clearance_field(seen if closed is None else seen | closed, resolution_m, _FAR_M)
    return LocalMap(stamp_s, resolution_m, origin.x, origin.y, cells, seen, field)
