"""Shared part of the packet LiDAR drivers: converts packets to the contract's sweeps and reports silence."""

from __future__ import annotations

import math
from functools import partial
from typing import Any, ClassVar, Protocol

import numpy as np

from robot_stack.contract import frames, topics
from robot_stack.core.config import ConfigError
from robot_stack.core.point_cloud import SWEEP
from robot_stack.core.range_sensor import RangeSensor
from robot_stack.drivers.counters import Counters
from robot_stack.drivers.nodes.mounting import mounting
from robot_stack.drivers.nodes.udp_socket import UdpSocket
from robot_stack.drivers.packet_lidar_params import PacketLidarParams
from robot_stack.drivers.sweep import Sweep
from robot_stack.middleware.conversions import time_from_s
from robot_stack.middleware.device_thread import DeviceThread
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.point_cloud import cloud_message, fill
from tf2_msgs.msg import TFMessage

_PAUSE_S = 0.2  # after an error of the network


class Builder(Protocol):
    """problem: why the newest packets give no sweep; empty if they do. model: of the sensor, once known."""

    counters: Counters
    model: str

    @property
    def problem(self) -> str: ...

    @property
    def drift_ppm(self) -> float: ...

    def received(self, data: bytes, arrival_s: float) -> Sweep | None: ...


class PacketLidarNode(StackNode, bulk=True):
    """Decodes packets in the reader's thread; the node wakes once a sweep. vendor: for people."""

    vendor: ClassVar[str]

    def __init__(self, name: str, parameters: type[PacketLidarParams]) -> None:
        super().__init__(name, parameters)
        params, sensor = self.params, self.robot.range_sensors[frames.LIDAR]
        self._builder = self.builder(sensor)
        self._message = cloud_message(np.empty(0, SWEEP), frames.LIDAR)
        self._sweeps = self.advertise(topics.LIDAR_POINTS)
        self._published_s = -math.inf
        self._arrived = False  # a packet since the last watch
        self._tf = self.advertise(topics.TF_STATIC)
        place = mounting(frames.LIDAR, sensor.xyz_m, self.robot.sensor_frame(frames.LIDAR), self.stamp())
        self._tf.publish(TFMessage(transforms=[place]))
        self._device = f"{self.vendor} at {params.device_ip}, port {params.port}"
        self.set_health(False, f"waiting for the {self._device}")
        self._socket = self._open(name)
        self._thread = DeviceThread(self._socket, _PAUSE_S)
        self.at_end.callback(self._socket.close)
        self.at_end.callback(self._thread.close)
        self.every(1.0 / params.silence_s, self._watch)

    def builder(self, sensor: RangeSensor) -> Builder:
        """The builder of sweeps from the vendor's packets. Raises ConfigError."""
        raise NotImplementedError

    def _open(self, name: str) -> UdpSocket:
        params: Any = self.params
        try:
            return UdpSocket(str(params.bind_address), params.port, str(params.device_ip), self._on_packet)
        except OSError as error:
            raise ConfigError(f"{name}: {params.bind_address} port {params.port}: {error.strerror}") from error

    def _on_packet(self, data: bytes) -> None:
        self._arrived = True
        sweep = self._builder.received(data, self.now_s())
        if sweep is not None:
            self.call_soon(partial(self._publish, sweep))

    def _publish(self, sweep: Sweep) -> None:
        fill(self._message, sweep.points)
        self._message.header.stamp = time_from_s(sweep.stamp_s)
        self._sweeps.publish(self._message)
        self._published_s = self.steady_s()
        self.report.values["points"] = str(len(sweep.points))

    def _watch(self) -> None:
        """Reports silence; old sweeps are never repeated."""
        builder = self._builder
        silent = self.steady_s() - self._published_s > self.params.silence_s
        arrived, self._arrived = self._arrived, False
        why = self._thread.problem((arrived and builder.problem) or f"no packets from the {self._device}")
        self.set_health(not silent, f"no sweeps: {why}" if silent else "sweeps arrive")
        self.report.values |= {
            "device": f"{builder.model or 'no packet yet'}, {self._device}",
            "packets of others": str(self._socket.of_others),
            "clock drift": f"{builder.drift_ppm:.1f} ppm",
            **builder.counters.values(),
        }
