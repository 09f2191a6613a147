"""Node lidar_driver: the simulated LiDAR, sweeps of where the bodies really are."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from pydantic import Field
from sensor_msgs.msg import PointCloud2

from robot_stack.contract import frames, services, topics
from robot_stack.core.config import Config
from robot_stack.core.point_cloud import SWEEP
from robot_stack.ros.conversions import time_from_s, time_to_s
from robot_stack.ros.node import StackNode, run
from robot_stack.ros.point_cloud import cloud_message, fill
from sim.camera.history import BASE
from sim.lidar.faults import FROZEN, RATE, SILENT, LidarFaultRefused, LidarFaults
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import build_scene
from sim.lidar.sensor import Lidar, Sweep, join
from sim.lidar.sweeper import Sweeper
from sim.nodes.bodies import matrix_of_transform
from sim.parameters import load_sim_params
from sim.people import PREFIX
from sim.worldfile import load_world
from tf2_msgs.msg import TFMessage


class LidarDriverParams(Config):
    """``config/lidar_driver.yaml``."""

    seed: Annotated[int, Field(ge=0)]
    world: str
    columns: Annotated[int, Field(ge=8, le=8192)] | None
    passenger: bool
    silence_s: Annotated[float, Field(gt=0.0)]


class LidarDriver(StackNode):
    """Measures a half sweep once the bodies' poses reach its end."""

    def __init__(self) -> None:
        super().__init__("lidar_driver", LidarDriverParams)
        self._sweeper = Sweeper(self._lidar())
        self._sweeper.lidar.warm_up()
        self._faults = LidarFaults()
        self._first: Sweep | None = None
        self._first_number, self._sent_s = -1, -np.inf
        empty = np.empty(0, SWEEP)
        self._half, self._full = cloud_message(empty, frames.LIDAR), cloud_message(empty, frames.LIDAR)
        self._halves, self._fulls = self.advertise(topics.LIDAR_HALF_SWEEP), self.advertise(topics.LIDAR_POINTS)
        self._tf = self.advertise(topics.TF_STATIC)
        self._tf.publish(TFMessage(transforms=[self._mounting()]))
        self._input = self.subscribe(topics.SIM_BODIES, self._on_bodies)
        self.serve(services.INJECT_LIDAR_FAULT, self._on_inject)
        self.set_health(False, f"waiting for {topics.SIM_BODIES.name}")
        self.every(2.0, self._watch)

    def _on_bodies(self, message: TFMessage) -> None:
        poses = {item.child_frame_id: matrix_of_transform(item.transform) for item in message.transforms}
        if BASE not in poses or not all(np.isfinite(pose).all() for pose in poses.values()):
            self.set_health(False, f"{topics.SIM_BODIES.name} without {BASE}, or with poses that are not finite")
            return
        self._sweeper.add(time_to_s(message.transforms[0].header.stamp), poses)
        due = self._sweeper.due()
        if due is not None:
            self._turn(*due)

    def _turn(self, number: int, end_s: float) -> None:
        """Half sweep ``number``; every even one completes a turn."""
        if self._faults.value(SILENT, end_s) is not None:
            return
        rate_hz = self._faults.value(RATE, end_s)
        if rate_hz is not None and number % 2 and end_s - self._sent_s < 1.0 / rate_hz - 1e-3:
            return
        if number % 2 == 0 and self._first_number != number - 1:
            return
        frozen = self._faults.value(FROZEN, end_s) is not None and len(self._full.data) > 0
        half = None if frozen else self._sweeper.take(number, end_s, self._faults.conditions(end_s))
        self._send(self._halves, self._half, half, end_s)
        if number % 2:
            self._first, self._first_number, self._sent_s = half, number, end_s
            return
        if frozen or half is None:
            self._send(self._fulls, self._full, None, end_s)
        elif self._first is not None:
            self._send(self._fulls, self._full, join(self._first, half), end_s)
        self.set_health(True, "the LiDAR measures")

    def _send(self, publisher: Any, message: PointCloud2, sweep: Sweep | None, end_s: float) -> None:
        """None: what was sent last, once more."""
        if sweep is not None:
            fill(message, sweep.points)
        message.header.stamp = time_from_s(end_s)
        publisher.publish(message)

    def _watch(self) -> None:
        if self._input.received and self._input.age_s() > self.params.silence_s:
            self.set_health(False, f"{topics.SIM_BODIES.name} has fallen silent")

    def _on_inject(self, request: Any, response: Any) -> Any:
        try:
            response.message = self._faults.inject(
                request.kind, request.target, request.value, request.duration_s, self.now_s()
            )
            response.success = True
            self.get_logger().warning(f"fault: {response.message}")
        except LidarFaultRefused as error:
            response.message = str(error)
        return response

    def _lidar(self) -> Lidar:
        world, params = load_world(self.params.world), load_lidar_params()
        if self.params.columns is not None:
            params = params.with_columns(self.params.columns)
        people = [f"{PREFIX}{person.name}" for person in world.people]
        chair = load_sim_params().wheelchair
        scene = build_scene(world, params, chair, people=people, passenger=self.params.passenger)
        return Lidar(scene, params, self.robot, self.params.seed)

    def _mounting(self) -> TransformStamped:
        """The nominal mounting: what the stack knows."""
        message = TransformStamped(child_frame_id=frames.LIDAR)
        message.header.frame_id, message.header.stamp = frames.BASE_LINK, self.stamp()
        place = message.transform.translation
        place.x, place.y, place.z = self.robot.lidar_xyz_m
        return message


def main() -> None:
    run(LidarDriver, bulk=True)


if __name__ == "__main__":
    main()
