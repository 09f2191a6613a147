"""Common base of the nodes of the simulated LiDARs: a sensor in the world, its faults, its clouds as bytes."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Annotated, ClassVar

import numpy as np
from geometry_msgs.msg import TransformStamped
from numpy.typing import NDArray
from pydantic import Field

from robot_stack.contract import topics
from robot_stack.contract.model import Service
from robot_stack.core.config import Config
from robot_stack.core.point_cloud import SWEEP, Points
from robot_stack.drivers.nodes.mounting import mounting
from robot_stack.middleware.conversions import time_from_s
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.point_cloud import cloud_message
from robot_stack.middleware.port import Publisher
from sim.lidar.faults import LidarFaults
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import build_scene
from sim.lidar.sensor import Lidar
from sim.lidar.shapes import Shape
from sim.lidar.sweeper import Sweeper
from sim.lidar.warm_up import warm_up
from sim.nodes.bodies import Bodies
from sim.nodes.fault_service import serve_faults
from sim.nodes.message_bytes import CloudBytes, restamped
from sim.params import load_sim_params
from sim.plant.people import PREFIX
from sim.worldfile import load_world
from tf2_msgs.msg import TFMessage

Clouds = list[tuple[Publisher, bytes]]
_END_S = 2.0


class LidarDriverParams(Config):
    """``config/lidar_driver.yaml`` and ``config/overhead_lidar_driver.yaml``."""

    seed: Annotated[int, Field(ge=0)]
    world: str
    # Where a real sensor's data goes instead of to its topic; empty: to the topic.
    wire: str
    columns: Annotated[int, Field(ge=8, le=8192)] | None
    passenger: bool
    silence_s: Annotated[float, Field(gt=0.0)]


class TurningLidar(StackNode, bulk=True):
    """Measures a part of a turn once the bodies' poses reach its end.

    sensor: of ``config/robot.yaml``, also its frame. parts: of a turn that are measured one by one.
    """

    sensor: ClassVar[str]
    parts: ClassVar[int]
    inject: ClassVar[Service]

    def __init__(self, name: str) -> None:
        super().__init__(name, LidarDriverParams)
        self.sweeper = Sweeper(self._lidar(), self.parts)
        warm_up()
        self.faults = LidarFaults()
        beams = self.sweeper.lidar.params.beams
        self.turn_points = np.empty(beams.columns * beams.rings, SWEEP)
        self._cloud = CloudBytes(cloud_message(np.empty(0, SWEEP), self.sensor))
        self._sent: dict[str, bytes] = {}
        if not self.params.wire:
            self._tf = self.advertise(topics.TF_STATIC)
            self._tf.publish(TFMessage(transforms=[self._mounting()]))
        self._worker = self.worker("lidar", world_waits=True)
        self.at_end.callback(self._worker.close, _END_S)
        self._bodies = Bodies(self, self._on_bodies)
        serve_faults(self, self.inject, self.inject_fault)
        self.set_health(False, f"waiting for {topics.SIM_BODIES.name}")
        self.every(2.0, self._watch)

    @abstractmethod
    def turn(self, number: int, end_s: float) -> None:
        """Measures and sends the completed part ``number``, counted from 1."""

    def own_shapes(self) -> list[Shape]:
        """The parts of the robot visible to the sensor."""
        return []

    def measure(self, job: Callable[[], Clouds]) -> None:
        """Runs ``job`` on the worker, one after the other, and publishes its clouds."""
        self._worker.submit(job, self._publish)

    def cloud(self, publisher: Publisher, points: Points | None, end_s: float) -> Clouds:
        """On the worker: the message of these points; None: the last measurement again."""
        stamp, topic = time_from_s(end_s), publisher.topic_name
        if points is not None:
            self._sent[topic] = self._cloud.filled(points, stamp)
        elif topic in self._sent:
            self._sent[topic] = restamped(self._sent[topic], stamp)
        return [(publisher, self._sent[topic])] if topic in self._sent else []

    def has_measured(self, publisher: Publisher) -> bool:
        return publisher.topic_name in self._sent

    def _publish(self, clouds: Clouds) -> None:
        for publisher, data in clouds:
            publisher.publish(data)
        if clouds or self.params.wire:
            self.set_health(True, f"{self.sensor} measures")

    def _on_bodies(self, time_s: float, poses: dict[str, NDArray[np.float64]]) -> None:
        self.sweeper.add(time_s, poses)
        due = self.sweeper.due()
        if due is not None:
            self.turn(*due)

    def _watch(self) -> None:
        self._bodies.watch(self.params.silence_s)

    def inject_fault(self, kind: str, target: str, value: float, duration_s: float) -> str:
        """Raises FaultRefused."""
        return self.faults.inject(kind, target, value, duration_s, self.now_s())

    def _lidar(self) -> Lidar:
        world, params = load_world(self.params.world), load_lidar_params(self.sensor)
        if self.params.columns is not None:
            params = params.with_columns(self.params.columns)
        people = [f"{PREFIX}{person.name}" for person in world.people]
        chair = load_sim_params().wheelchair
        scene = build_scene(world, params, chair, people=people, passenger=self.params.passenger, own=self.own_shapes())
        return Lidar(scene, params, self.robot, self.params.seed, self.sensor)

    def _mounting(self) -> TransformStamped:
        """The nominal mounting, as used by the stack."""
        robot, sensor = self.robot, self.sensor
        return mounting(sensor, robot.range_sensors[sensor].xyz_m, robot.sensor_frame(sensor), self.stamp())
