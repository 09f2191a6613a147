"""Node overhead_lidar_driver: the simulated LiDAR at the mast's boom; it also sees the robot and its passenger."""

from __future__ import annotations

import numpy as np

from robot_stack.contract import frames, services, topics
from robot_stack.core.robot_shape import load_robot_shape
from robot_stack.middleware.node import run
from sim.lidar.bodies import robot_shapes
from sim.lidar.faults import FROZEN, RATE, SILENT
from sim.lidar.shapes import Shape
from sim.nodes.turning_lidar import TurningLidar


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
        if self.faults.value(FROZEN, end_s) is not None and self.has_sent(self._frames):
            self.send(self._frames, None, end_s)
            return
        sweep = self.sweeper.take(number, end_s, self.faults.conditions(end_s), self.turn_points)
        self.send(self._frames, sweep.points, end_s)
        self.set_health(True, "the overhead LiDAR measures")


def main() -> None:
    run(OverheadLidarDriverNode, bulk=True)


if __name__ == "__main__":
    main()
