"""Node overhead_lidar_driver: the simulated LiDAR at the mast's boom; its view includes the robot and its passenger."""

from __future__ import annotations

import numpy as np

from robot_stack.contract import frames, services, topics
from robot_stack.core.robot_shape import load_robot_shape
from robot_stack.middleware.node import run
from sim.lidar.bodies import robot_shapes
from sim.lidar.faults import FROZEN, RATE, SILENT
from sim.lidar.sensor import Conditions
from sim.lidar.shapes import Shape
from sim.lidar.sweeper import Tracks
from sim.nodes.turning_lidar import Clouds, TurningLidar


class OverheadLidarDriverNode(TurningLidar):
    """A frame for each period."""

    sensor, parts, inject = frames.OVERHEAD_LIDAR, 1, services.INJECT_OVERHEAD_LIDAR_FAULT

    def __init__(self) -> None:
        super().__init__("overhead_lidar_driver")
        self._sent_s = -np.inf
        self._frames = self.advertise(topics.OVERHEAD_LIDAR_POINTS)

    def own_shapes(self) -> list[Shape]:
        return robot_shapes(self.robot, load_robot_shape())

    def turn(self, number: int, end_s: float) -> None:
        if self.faults.value(SILENT, end_s) is not None:
            return
        rate_hz = self.faults.value(RATE, end_s)
        if rate_hz is not None and end_s - self._sent_s < 1.0 / rate_hz - 1e-3:
            return
        self._sent_s = end_s
        frozen = self.faults.value(FROZEN, end_s) is not None
        conditions, tracks = self.faults.conditions(end_s), self.sweeper.tracks()
        self.measure(lambda: self._frame(number, end_s, tracks, conditions, frozen=frozen))

    def _frame(self, number: int, end_s: float, tracks: Tracks, conditions: Conditions, *, frozen: bool) -> Clouds:
        """On the worker. A frozen sensor repeats its last measurement."""
        if frozen and self.has_measured(self._frames):
            return self.cloud(self._frames, None, end_s)
        sweep = self.sweeper.measure(tracks, number, end_s, conditions, self.turn_points)
        return self.cloud(self._frames, sweep.points, end_s)


def main() -> None:
    run(OverheadLidarDriverNode, bulk=True)


if __name__ == "__main__":
    main()
