"""The local costmap: perception's grid of the space around the robot, inflated by the footprint in force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.robot import Robot
from robot_stack.costmap.inflation import cost_table, inflated
from robot_stack.costmap.params import CostmapParams

Cells = NDArray[np.int8]

_STATES = (-1, 0, 100)


@dataclass(frozen=True, slots=True)
class Space:
    """state: (rows, columns) -1 unseen, 0 free, 100 occupied, row 0 at the lowest y."""

    state: Cells
    resolution_m: float


def space_problem(space: Space, size: tuple[int, int]) -> str:
    """Why a grid is refused, else an empty text. size: its declared (rows, columns)."""
    if not 0.01 <= space.resolution_m <= 0.5:
        return f"info.resolution is {space.resolution_m}, must be 0.01 to 0.5 m"
    if min(size) < 1 or space.state.size != size[0] * size[1]:
        return f"data has {space.state.size} cells, must be {size[0]} x {size[1]}"
    if not np.isin(space.state, _STATES).all():
        return f"data has other cells than {', '.join(map(str, _STATES))}"
    return ""


class LocalCostmap:
    """chair: the footprint in force is the one with the wheelchair."""

    def __init__(self, params: CostmapParams, robot: Robot) -> None:
        self._params, self._robot = params, robot
        self._tables: dict[tuple[bool, float], NDArray[np.int8]] = {}
        self.chair = False

    def costs(self, space: Space) -> Cells:
        """(rows, columns) costs as in an OccupancyGrid."""
        return inflated(space.state, self._table(space.resolution_m))

    def _table(self, resolution_m: float) -> NDArray[np.int8]:
        key = (self.chair, resolution_m)
        if key not in self._tables:
            footprint = self._robot.footprint_with_chair if self.chair else self._robot.footprint
            inflation = self._params.inflation
            self._tables[key] = cost_table(footprint, inflation.beyond_m, inflation.scaling_per_m, resolution_m)
        return self._tables[key]
