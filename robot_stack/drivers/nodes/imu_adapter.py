"""Node imu_adapter: an inertial unit by its vendor's own ROS driver as /sensors/imu."""

from __future__ import annotations

from sensor_msgs.msg import Imu

from robot_stack.contract import topics
from robot_stack.drivers.nodes.imu_output import ImuOutput
from robot_stack.drivers.nodes.vendor_input import VendorInput
from robot_stack.drivers.vendor.imu import ImuAdapter, ImuAdapterParams
from robot_stack.middleware.node import StackNode


class ImuAdapterNode(StackNode):
    def __init__(self) -> None:
        super().__init__("imu_adapter", ImuAdapterParams)
        self._adapter = ImuAdapter(self.params)
        self._output = ImuOutput(self, self.params)
        self._input = VendorInput(self, topics.VENDOR_IMU, self.params, topics.IMU.nominal_rate_hz, self._publish)
        self.set_health(False, f"waiting for {self.params.topic}")
        self.every(1.0 / self.params.silence_s, self._watch)

    def _publish(self, message: Imu, stamp_s: float) -> None:
        q, force, rate = message.orientation, message.linear_acceleration, message.angular_velocity
        covariances = (
            message.orientation_covariance[0],
            message.linear_acceleration_covariance[0],
            message.angular_velocity_covariance[0],
        )
        sample = self._adapter.convert(
            message.header.frame_id,
            (q.x, q.y, q.z, q.w),
            (force.x, force.y, force.z, rate.x, rate.y, rate.z),
            covariances,
            stamp_s,
        )
        self._output.publish(sample)

    def _watch(self) -> None:
        """Reports silence and refusals; old samples are never repeated."""
        problem = self._input.problem()
        self.set_health(not problem, problem or "samples arrive")
        self.report.values |= {**self._input.values(), **self._adapter.counters.values()}
