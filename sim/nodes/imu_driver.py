"""Node imu_driver: the simulated inertial unit as /sensors/imu, or on a serial line."""

from __future__ import annotations

from typing import Annotated

from builtin_interfaces.msg import Time
from pydantic import Field

from robot_stack.contract import topics
from robot_stack.core.config import Config
from robot_stack.core.runtime import runtime_dir
from robot_stack.drivers.nodes.imu_output import SIGMAS, imu_message, imu_mounting
from robot_stack.middleware.node import StackNode
from sim.devices.imu_line import ImuLine
from sim.nodes.message_bytes import Numbers
from sim.plant.imu import ImuSample
from tf2_msgs.msg import TFMessage

Sigma = Annotated[float, Field(gt=0.0)]


class ImuDriverParams(Config):
    """``config/imu_driver.yaml``; standard deviations.

    port: a pseudo terminal in the runtime folder, on which an Xsens unit sends; empty: no line, but the topic.
    """

    acceleration_sigma_mps2: Sigma
    rotation_sigma_radps: Sigma
    attitude_sigma_rad: Sigma
    heading_sigma_rad: Sigma
    silence_s: Annotated[float, Field(gt=0.0)]
    port: str


class ImuDriver(StackNode):
    def __init__(self) -> None:
        super().__init__("imu_driver", ImuDriverParams)
        self._last_s: float | None = None
        port = self.params.port
        self._line = ImuLine(runtime_dir() / port) if port else None
        self._message = Numbers(imu_message(**self.params.model_dump(include=SIGMAS)))
        if self._line is None:
            self._samples = self.advertise(topics.IMU)
            self._tf = self.advertise(topics.TF_STATIC)
            self._tf.publish(TFMessage(transforms=[imu_mounting(self)]))

    def publish(self, sample: ImuSample, stamp: Time) -> None:
        self._last_s = sample.time_s
        if self._line is not None:
            self._line.send(sample)
            return
        message = self._message
        message.put(37, sample.orientation_xyzw)  # each of the three stands before its covariance
        message.put(24, sample.rotation_radps)
        message.put(12, sample.acceleration_mps2)
        self._samples.publish(message.stamped(stamp))

    def watch(self, time_s: float) -> None:
        """Checks in simulated time whether the unit still sends."""
        age_s = time_s - (self._last_s or 0.0)
        silent = age_s > self.params.silence_s
        self.set_health(not silent, "the inertial unit sends nothing" if silent else "samples arrive")
