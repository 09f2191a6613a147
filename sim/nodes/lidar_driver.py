"""Node lidar_driver: the simulated LiDAR, sweeps of the bodies' true poses as clouds or as an Ouster's packets."""

from __future__ import annotations

import numpy as np

from robot_stack.contract import frames, services, topics
from robot_stack.core.config import ConfigError
from robot_stack.core.point_cloud import Points
from sim.devices.ouster import OusterSensor
from sim.devices.udp import UdpSender
from sim.lidar.faults import FROZEN, RATE, SILENT
from sim.lidar.params import Beams
from sim.lidar.sensor import Conditions, Sweep
from sim.lidar.sweeper import Tracks
from sim.nodes.turning_lidar import Clouds, TurningLidar


class LidarDriverNode(TurningLidar):
    """Publishes half sweeps, and the full sweeps of two of them."""

    sensor, parts, inject = frames.LIDAR, 2, services.INJECT_LIDAR_FAULT

    def __init__(self) -> None:
        super().__init__("lidar_driver")
        self._first: Sweep | None = None
        self._first_number, self._sent_s = -1, -np.inf
        self._head = _Head(self.params.wire, self.sweeper.lidar.params.beams) if self.params.wire else None
        if self._head is None:
            self._halves, self._fulls = self.advertise(topics.LIDAR_HALF_SWEEP), self.advertise(topics.LIDAR_POINTS)

    def turn(self, number: int, end_s: float) -> None:
        """Half sweep ``number``; every even one completes a turn."""
        if self.faults.value(SILENT, end_s) is not None:
            return
        rate_hz = self.faults.value(RATE, end_s)
        if rate_hz is not None and number % 2 and end_s - self._sent_s < 1.0 / rate_hz - 1e-3:
            return
        if number % 2:
            self._first_number, self._sent_s = number, end_s
        elif self._first_number != number - 1:
            return
        frozen = self.faults.value(FROZEN, end_s) is not None
        conditions, tracks = self.faults.conditions(end_s), self.sweeper.tracks()
        if self._head is not None:
            self.measure(lambda: self._packets(number, end_s, tracks, conditions, frozen=frozen))
            return
        self.measure(lambda: self._half(number, end_s, tracks, conditions, frozen=frozen))

    def _packets(self, number: int, end_s: float, tracks: Tracks, conditions: Conditions, *, frozen: bool) -> Clouds:
        """On the worker. Sends half sweep ``number``; no clouds."""
        assert self._head is not None
        half = None if frozen else self.sweeper.measure(tracks, number, end_s, conditions).points
        self._head.send(number, end_s, half)
        return []

    def _half(self, number: int, end_s: float, tracks: Tracks, conditions: Conditions, *, frozen: bool) -> Clouds:
        """On the worker. A frozen sensor repeats its last measurement."""
        begin = 0 if number % 2 or self._first is None else len(self._first.points)
        half: Sweep | None = None
        if not (frozen and self.has_measured(self._fulls)):
            # The second half of a turn follows the first in the same memory, as needed for the full sweep.
            half = self.sweeper.measure(tracks, number, end_s, conditions, self.turn_points[begin:])
        clouds = self.cloud(self._halves, half.points if half else None, end_s)
        if number % 2:
            self._first = half
        elif half is None:
            clouds += self.cloud(self._fulls, None, end_s)
        elif self._first is not None:
            clouds += self.cloud(self._fulls, self._joined(self._first, half), end_s)
        return clouds

    def destroy_node(self) -> None:
        super().destroy_node()
        if self._head is not None:
            self._head.close()

    def _joined(self, first: Sweep, second: Sweep) -> Points:
        """The full sweep of two halves: all times are before the second's stamp."""
        first.points["time"] -= np.float32(second.stamp_s - first.stamp_s)
        return self.turn_points[: len(first.points) + len(second.points)]


class _Head:
    """The sensor as its network interface. port: of this computer. Raises ConfigError."""

    def __init__(self, port: str, beams: Beams) -> None:
        try:
            self._sensor, self._sender = OusterSensor(beams), UdpSender(int(port))
        except ValueError as error:
            raise ConfigError(f"lidar_driver: wire {port!r}: {error}") from error
        self._half = beams.columns // 2
        self._sent: dict[int, Points] = {}

    def send(self, number: int, end_s: float, points: Points | None) -> None:
        """The packets of half sweep ``number``. points: ``SWEEP``; None is the last ones of this half again."""
        first = 0 if number % 2 else self._half
        points = self._sent.get(first) if points is None else points
        if points is not None:
            self._sent[first] = points
            self._sender.send(self._sensor.packets(points, (number - 1) // 2, (first, first + self._half), end_s))

    def close(self) -> None:
        self._sender.close()
