"""costmap_server: /perception/space to /local_costmap/costmap."""

from __future__ import annotations

from array import array

import numpy as np
from nav_msgs.msg import OccupancyGrid

from robot_stack.contract import frames, topics
from robot_stack.costmap.costmap import LocalCostmap, Space, space_problem
from robot_stack.costmap.params import CostmapParams
from robot_stack.middleware.conversions import time_to_s
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.wheelchair import WheelchairInput


class CostmapServerNode(StackNode):
    """Publishes a costmap for each grid, with its stamp, while obstacles are fresh: without them the grid does not
    show the surroundings."""

    def __init__(self) -> None:
        super().__init__("costmap_server", CostmapParams)
        self._costmap = LocalCostmap(self.params, self.robot)
        self._problem = ""
        self._grid = self.advertise(topics.LOCAL_COSTMAP)
        self._obstacles = self.subscribe(topics.OBSTACLES)
        self._space = self.subscribe(topics.SPACE, self._on_space)
        WheelchairInput(self, self._on_wheelchair)
        self._look()
        self.every(topics.LOCAL_COSTMAP.nominal_rate_hz, self._look)

    def _on_wheelchair(self, attached: bool) -> None:
        self._costmap.chair = attached

    def _on_space(self, message: OccupancyGrid) -> None:
        begin_s = self.monotonic_s()
        # A float32: its 0.05 is 7e-10 too large, which would put a cell at the inscribed radius beyond it.
        space = Space(np.frombuffer(message.data, np.int8), round(message.info.resolution, 6))
        self._problem = self._problem_of(message, space)
        if self._problem:
            self.get_logger().error(self._problem, throttle_duration_sec=1.0)
            return
        rows, columns = message.info.height, message.info.width
        costs = self._costmap.costs(Space(space.state.reshape(rows, columns), space.resolution_m))
        message.data = array("b", costs.tobytes())
        self._grid.publish(message)
        self.report.values["update"] = f"{1e3 * (self.monotonic_s() - begin_s):.1f} ms"

    def _problem_of(self, message: OccupancyGrid, space: Space) -> str:
        """Why a grid is refused, else an empty text."""
        if message.header.frame_id != frames.ODOM:
            return f"space refused: frame_id is {message.header.frame_id!r}, must be {frames.ODOM!r}"
        age_s = self.now_s() - time_to_s(message.header.stamp)
        if not age_s <= topics.SPACE.stale_limit_s:
            return f"space refused: it is {age_s:.2f} s old"
        if not self._obstacles.fresh():
            return f"waiting for {topics.OBSTACLES.name}"
        problem = space_problem(space, (message.info.height, message.info.width))
        return f"space refused: {problem}" if problem else ""

    def _look(self) -> None:
        """Reports why nothing is published."""
        silent = [entry.topic.name for entry in (self._obstacles, self._space) if not entry.fresh()]
        if silent:
            self.set_health(False, f"waiting for {', '.join(silent)}")
        else:
            self.set_health(not self._problem, self._problem or "mapping")
