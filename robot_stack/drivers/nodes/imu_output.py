"""The samples of an inertial unit on /sensors/imu, and its place on /tf_static."""

from __future__ import annotations

from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu

from robot_stack.contract import frames, topics
from robot_stack.drivers.imu import ImuParams, Sample
from robot_stack.drivers.nodes.mounting import mounting
from robot_stack.middleware.conversions import time_from_s
from robot_stack.middleware.node import StackNode
from tf2_msgs.msg import TFMessage


class ImuOutput:
    """Publishes samples in base_link's axes, with the configured covariances."""

    def __init__(self, node: StackNode, params: ImuParams) -> None:
        self._message = _empty(params)
        self._samples = node.advertise(topics.IMU)
        self._tf = node.advertise(topics.TF_STATIC)
        # Published data is in base_link's axes, whatever the unit's mounting rotation.
        upright = Rotation.identity().as_matrix()
        self._tf.publish(TFMessage(transforms=[mounting(frames.IMU, node.robot.imu_xyz_m, upright, node.stamp())]))

    def publish(self, sample: Sample) -> None:
        message = self._message
        message.header.stamp = time_from_s(sample.stamp_s)
        turned, rate, force = message.orientation, message.angular_velocity, message.linear_acceleration
        turned.x, turned.y, turned.z, turned.w = sample.orientation_xyzw
        rate.x, rate.y, rate.z = sample.rotation_radps
        force.x, force.y, force.z = sample.acceleration_mps2
        self._samples.publish(message)


def _empty(params: ImuParams) -> Imu:
    message = Imu()
    message.header.frame_id = frames.IMU
    level, heading = params.attitude_sigma_rad**2, params.heading_sigma_rad**2
    message.orientation_covariance[0] = message.orientation_covariance[4] = level
    message.orientation_covariance[8] = heading
    for i in (0, 4, 8):
        message.angular_velocity_covariance[i] = params.rotation_sigma_radps**2
        message.linear_acceleration_covariance[i] = params.acceleration_sigma_mps2**2
    return message
