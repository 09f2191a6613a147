"""Node overhead_lidar_driver: the simulated LiDAR at the mast's boom; its view includes the robot and its passenger."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robot_stack.contract import frames, services, topics
from robot_stack.core.point_cloud import Points, xyz_of
from robot_stack.core.robot_shape import load_robot_shape
from robot_stack.middleware.conversions import time_from_s
from robot_stack.middleware.point_cloud import cloud_message
from sim.lidar.bodies import robot_shapes
from sim.lidar.faults import FROZEN, RATE, SILENT
from sim.lidar.sensor import Conditions
from sim.lidar.shapes import Shape
from sim.lidar.sweeper import Tracks
from sim.nodes.message_bytes import CloudBytes
from sim.nodes.turning_lidar import Clouds, TurningLidar

# One point as the Livox driver publishes it, Livox-SDK/livox_ros_driver2 src/lddc.cpp, xfer_format: 0.
_LIVOX = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("intensity", "<f4"),
        ("tag", "u1"),
        ("line", "u1"),
        ("timestamp", "<f8"),
    ]
)
_LIVOX_FRAME = "livox_frame"


class OverheadLidarDriverNode(TurningLidar):
    """A frame for each period."""

    sensor, parts, inject = frames.OVERHEAD_LIDAR, 1, services.INJECT_OVERHEAD_LIDAR_FAULT

    def __init__(self) -> None:
        super().__init__("overhead_lidar_driver")
        self._sent_s = -np.inf
        if self.params.wire:
            row = replace(topics.OVERHEAD_VENDOR_POINTS, publishers=(self.get_name(),))
            self._frames = self.advertise(row, self.params.wire)
            self._vendor = CloudBytes(cloud_message(np.empty(0, _LIVOX), _LIVOX_FRAME))
        else:
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
        if self.params.wire:
            return [(self._frames, self._of_vendor(sweep.points, end_s))]
        return self.cloud(self._frames, sweep.points, end_s)

    def _of_vendor(self, points: Points, end_s: float) -> bytes:
        """The cloud in the sensor's own axes, stamped at its first point."""
        cloud = np.zeros(len(points), _LIVOX)
        own = xyz_of(points) @ self.robot.to_sensor_frame(self.sensor)  # of rows: the inverse of the rotation
        cloud["x"], cloud["y"], cloud["z"] = own.T
        cloud["intensity"], cloud["line"] = points["intensity"], points["ring"]
        times_s = end_s + points["time"].astype(np.float64)
        cloud["timestamp"] = 1e9 * times_s
        return self._vendor.filled(cloud, time_from_s(float(times_s[0]) if len(times_s) else end_s))
