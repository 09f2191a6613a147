"""Node xsens_driver: an Xsens inertial unit on a serial line as /sensors/imu."""

from __future__ import annotations

import math
from functools import partial

from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu

from robot_stack.contract import frames, topics
from robot_stack.core.runtime import runtime_dir
from robot_stack.drivers.nodes.mounting import mounting
from robot_stack.drivers.nodes.serial_line import SerialLine
from robot_stack.drivers.xsens.params import XsensDriverParams
from robot_stack.drivers.xsens.unit import START, Sample, Unit
from robot_stack.middleware.conversions import time_from_s
from robot_stack.middleware.device_thread import DeviceThread
from robot_stack.middleware.node import StackNode, run
from tf2_msgs.msg import TFMessage


class XsensDriverNode(StackNode):
    """Bytes are timestamped in the reader's thread; all else happens in the node's."""

    def __init__(self) -> None:
        super().__init__("xsens_driver", XsensDriverParams)
        self._unit = Unit(self.params)
        self._message = self._make_message()
        self._samples = self.advertise(topics.IMU)
        self._sampled_s = -math.inf
        self._tf = self.advertise(topics.TF_STATIC)
        # Published data is in base_link's axes, whatever the unit's mounting rotation.
        upright = Rotation.identity().as_matrix()
        self._tf.publish(TFMessage(transforms=[mounting(frames.IMU, self.robot.imu_xyz_m, upright, self.stamp())]))
        # An absolute path replaces the runtime folder.
        port = str(runtime_dir() / self.params.serial.port)
        self.set_health(False, f"waiting for the inertial unit on {port}")
        serial = self.params.serial
        line = SerialLine(port, self.params.baud_rate, serial, START, self._on_opened, self._on_bytes)
        self._thread = DeviceThread(line, serial.reopen_s)
        self.every(1.0 / self.params.silence_s, self._watch)

    def _on_opened(self) -> None:
        self.call_soon(self._unit.opened)

    def _on_bytes(self, data: bytes) -> None:
        self.call_soon(partial(self._take, data, self.now_s()))

    def _take(self, data: bytes, arrival_s: float) -> None:
        for sample in self._unit.received(data, arrival_s):
            self._publish(sample)

    def _publish(self, sample: Sample) -> None:
        message = self._message
        message.header.stamp = time_from_s(sample.stamp_s)
        turned, rate, force = message.orientation, message.angular_velocity, message.linear_acceleration
        turned.x, turned.y, turned.z, turned.w = sample.orientation_xyzw
        rate.x, rate.y, rate.z = sample.rotation_radps
        force.x, force.y, force.z = sample.acceleration_mps2
        self._samples.publish(message)
        self._sampled_s = self.steady_s()

    def _watch(self) -> None:
        silent = self.steady_s() - self._sampled_s > self.params.silence_s
        if silent:
            self.set_health(False, f"no samples: {self._unit.problem or self._thread.state}")
        elif not self._unit.settled:
            self.set_health(True, "samples arrive; the unit's orientation is not settled yet")
        else:
            self.set_health(True, "samples arrive")
        self.report.values |= {
            "device": f"Xsens on {self._thread.state}",
            "opened": f"{self._thread.opened} times",
            "clock drift": f"{self._unit.drift_ppm:.1f} ppm",
            **self._unit.counters.values(),
        }

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

    def destroy_node(self) -> None:
        self._thread.close()
        super().destroy_node()


def main() -> None:
    run(XsensDriverNode)
