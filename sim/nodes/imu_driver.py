"""Node imu_driver: the simulated inertial unit as /sensors/imu."""

from __future__ import annotations

from typing import Annotated

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from pydantic import Field
from sensor_msgs.msg import Imu

from robot_stack.contract import frames, topics
from robot_stack.core.config import Config
from robot_stack.middleware.node import StackNode
from sim.nodes.message_bytes import Numbers
from sim.plant.imu import ImuSample
from tf2_msgs.msg import TFMessage

Sigma = Annotated[float, Field(gt=0.0)]


class ImuDriverParams(Config):
    """``config/imu_driver.yaml``; standard deviations."""

    acceleration_sigma_mps2: Sigma
    rotation_sigma_radps: Sigma
    attitude_sigma_rad: Sigma
    heading_sigma_rad: Sigma
    silence_s: Annotated[float, Field(gt=0.0)]


class ImuDriver(StackNode):
    def __init__(self) -> None:
        super().__init__("imu_driver", ImuDriverParams)
        self._samples = self.advertise(topics.IMU)
        self._message = Numbers(self._make_message())
        self._last_s: float | None = None
        self._tf = self.advertise(topics.TF_STATIC)
        self._tf.publish(TFMessage(transforms=[self._mounting()]))

    def publish(self, sample: ImuSample, stamp: Time) -> None:
        message = self._message
        message.put(37, sample.orientation_xyzw)  # each of the three stands before its covariance
        message.put(24, sample.rotation_radps)
        message.put(12, sample.acceleration_mps2)
        self._samples.publish(message.stamped(stamp))
        self._last_s = sample.time_s

    def watch(self, time_s: float) -> None:
        """Checks in simulated time whether the unit still sends."""
        age_s = time_s - (self._last_s or 0.0)
        silent = age_s > self.params.silence_s
        self.set_health(not silent, "the inertial unit sends nothing" if silent else "samples arrive")

    def _make_message(self) -> Imu:
        message, params = Imu(), self.params
        message.header.frame_id = frames.IMU
        level, heading = params.attitude_sigma_rad**2, params.heading_sigma_rad**2
        message.orientation_covariance[0] = message.orientation_covariance[4] = level
        message.orientation_covariance[8] = heading
        for i in (0, 4, 8):
            message.angular_velocity_covariance[i] = params.rotation_sigma_radps**2
            message.linear_acceleration_covariance[i] = params.acceleration_sigma_mps2**2
        return message

    def _mounting(self) -> TransformStamped:
        transform = TransformStamped(child_frame_id=frames.IMU)
        transform.header.frame_id, transform.header.stamp = frames.BASE_LINK, self.stamp()
        place = transform.transform.translation
        place.x, place.y, place.z = self.robot.imu_xyz_m
        transform.transform.rotation.w = 1.0
        return transform
