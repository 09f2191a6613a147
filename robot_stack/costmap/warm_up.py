"""Compiles the kernels of the costmap, or loads them, before the first grid."""

from __future__ import annotations

import numpy as np

from robot_stack.core.config import load
from robot_stack.core.robot import load_robot
from robot_stack.costmap.costmap import LocalCostmap, Space
from robot_stack.costmap.params import CostmapParams


def warm_up() -> None:
    """Inflates a small grid of obstacles."""
    costmap = LocalCostmap(load(CostmapParams, "costmap_server"), load_robot())
    costmap.costs(Space(np.full((20, 20), 100, np.int8), 0.05))
