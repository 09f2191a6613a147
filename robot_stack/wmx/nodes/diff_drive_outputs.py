"""Publishers of the differential drive: the accepted command, the wheel speeds, odometry and its transform."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry as OdometryMessage
from std_msgs.msg import Float64MultiArray

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.geometry import covariance_of_message
from robot_stack.middleware.conversions import pose_to_msg, transform_stamped
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.port import Publisher
from robot_stack.wmx.differential.kinematics import WheelPair
from robot_stack.wmx.differential.odometry import Odometry
from robot_stack.wmx.differential.params import DiffDriveParams, named, twist_covariance
from tf2_msgs.msg import TFMessage


class DiffDriveOutputs:
    """Publishers of the node ``diff_drive_controller``; none for a topic without a name."""

    def __init__(self, node: StackNode, params: DiffDriveParams) -> None:
        self._node = node
        self._frames = params.odom_frame, params.base_frame
        self._measured = OdometryMessage(
            child_frame_id=params.base_frame
        )  # reused by all ticks, because most of it never changes
        self._measured.header.frame_id = params.odom_frame
        self._measured.twist.covariance = twist_covariance(params.odometry)
        self._echo = self._optional(topics.WMX_CMD_VEL_CHECK, params.encoder_vel_topic)
        self._speeds = self._optional(topics.WMX_WHEEL_VELOCITIES, params.encoder_omega_topic)
        self._odom = self._optional(topics.WMX_ODOM_ENC, params.encoder_odometry_topic)
        self._tf = node.advertise(topics.WMX_TF) if params.publish_tf else None

    def _optional(self, row: Topic, name: str) -> Publisher | None:
        return self._node.advertise(row, name=name) if named(name) else None

    def echo(self, command: Twist) -> None:
        if self._echo is not None:
            self._echo.publish(command)

    def wheels(self, speeds: WheelPair) -> None:
        """rad/s."""
        if self._speeds is not None:
            self._speeds.publish(Float64MultiArray(data=[speeds.left, speeds.right]))

    def odometry(self, twist: tuple[float, float], odometry: Odometry | None, stamp: Time) -> None:
        """twist: forward speed in m/s and turning rate in rad/s. odometry: None while the pose is not published."""
        message = self._measured
        message.header.stamp = stamp
        message.twist.twist.linear.x, message.twist.twist.angular.z = twist
        if odometry is not None:
            message.pose.pose = pose_to_msg(odometry.pose)
            message.pose.covariance = covariance_of_message(odometry.covariance)
            if self._tf is not None:
                self._tf.publish(TFMessage(transforms=[transform_stamped(odometry.pose, *self._frames, stamp)]))
        if self._odom is not None:
            self._odom.publish(message)
