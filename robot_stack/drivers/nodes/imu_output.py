"""The samples of an inertial unit on /sensors/imu, and its place on /tf_static."""

from __future__ import annotations

from geometry_msgs.msg import TransformStamped
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu

from robot_stack.contract import frames, topics
from robot_stack.drivers.imu import ImuParams, Sample
from robot_stack.drivers.nodes.mounting import mounting
from robot_stack.middleware.conversions import time_from_s
from robot_stack.middleware.node import StackNode
from tf2_msgs.msg import TFMessage

SIGMAS = {"acceleration_sigma_mps2", "rotation_sigma_radps", "attitude_sigma_rad", "heading_sigma_rad"}


class ImuOutput:
    """Publishes samples in base_link's axes, with the configured covariances."""

    def __init__(self, node: StackNode, params: ImuParams) -> None:
        self._message = imu_message(**params.model_dump(include=SIGMAS))
        self._samples = node.advertise(topics.IMU)
        self._tf = node.advertise(topics.TF_STATIC)
        self._tf.publish(TFMessage(transforms=[imu_mounting(node)]))

    def publish(self, sample: Sample) -> None:
        message = self._message
        message.header.stamp = time_from_s(sample.stamp_s)
        turned, rate, force = message.orientation, message.angular_velocity, message.linear_acceleration
        turned.x, turned.y, turned.z, turned.w = sample.orientation_xyzw
        rate.x, rate.y, rate.z = sample.rotation_radps
        force.x, force.y, force.z = sample.acceleration_mps2
        self._samples.publish(message)


def imu_mounting(node: StackNode) -> TransformStamped:
    """The unit's place. Published data is in base_link's axes, whatever the unit's mounting rotation."""
    return mounting(frames.IMU, node.robot.imu_xyz_m, Rotation.identity().as_matrix(), node.stamp())


def imu_message(
    *, acceleration_sigma_mps2: float, rotation_sigma_radps: float, attitude_sigma_rad: float, heading_sigma_rad: float
) -> Imu:
    """A message without values, with its frame and covariances; see ``ImuParams``."""
    message = Imu()
    message.header.frame_id = frames.IMU
    message.orientation_covariance[0] = message.orientation_covariance[4] = attitude_sigma_rad**2
    message.orientation_covariance[8] = heading_sigma_rad**2
    for i in (0, 4, 8):
        message.angular_velocity_covariance[i] = rotation_sigma_radps**2
        message.linear_acceleration_covariance[i] = acceleration_sigma_mps2**2
    return message
