"""Conversions between ROS messages and the values that kernels use."""

from __future__ import annotations

import numpy as np
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import (
    Pose,
    PoseStamped,
    PoseWithCovarianceStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Twist,
    TwistStamped,
)
from sensor_msgs.msg import CameraInfo

from robot_stack.core.camera import Intrinsics
from robot_stack.core.geometry import Pose2, Twist2, planar_pose, quaternion_from_yaw

NANOSECONDS = 1_000_000_000


def time_to_s(stamp: Time) -> float:
    return float(stamp.sec + stamp.nanosec / NANOSECONDS)


def time_from_s(seconds: float) -> Time:
    nanoseconds = round(seconds * NANOSECONDS)
    return Time(sec=nanoseconds // NANOSECONDS, nanosec=nanoseconds % NANOSECONDS)


def duration_from_s(seconds: float) -> Duration:
    whole, nanoseconds = divmod(round(seconds * NANOSECONDS), NANOSECONDS)
    return Duration(sec=whole, nanosec=nanoseconds)


def twist_to_msg(twist: Twist2) -> Twist:
    message = Twist()
    message.linear.x, message.linear.y, message.angular.z = float(twist.vx), float(twist.vy), float(twist.omega)
    return message


def twist_from_msg(message: Twist) -> Twist2:
    return Twist2(message.linear.x, message.linear.y, message.angular.z)


def twist_fields(message: Twist) -> dict[str, float]:
    """All six numbers by the names of their fields: ``linear.x`` and so on."""
    parts = {"linear": message.linear, "angular": message.angular}
    return {f"{name}.{axis}": getattr(part, axis) for name, part in parts.items() for axis in "xyz"}


def twist_stamped(twist: Twist2, frame_id: str, stamp: Time) -> TwistStamped:
    message = TwistStamped(twist=twist_to_msg(twist))
    message.header.frame_id, message.header.stamp = frame_id, stamp
    return message


def quaternion_to_msg(yaw_rad: float) -> Quaternion:
    x, y, z, w = quaternion_from_yaw(yaw_rad)
    return Quaternion(x=x, y=y, z=z, w=w)


def pose_to_msg(pose: Pose2) -> Pose:
    message = Pose(orientation=quaternion_to_msg(pose.yaw))
    message.position.x, message.position.y = float(pose.x), float(pose.y)
    return message


def pose_from_msg(message: Pose) -> Pose2:
    return planar_pose(message.position, message.orientation)


def pose_from_transform(message: Transform) -> Pose2:
    return planar_pose(message.translation, message.rotation)


def pose_stamped(pose: Pose2, frame_id: str, stamp: Time) -> PoseStamped:
    message = PoseStamped(pose=pose_to_msg(pose))
    message.header.frame_id, message.header.stamp = frame_id, stamp
    return message


def initial_pose(
    pose: Pose2, frame_id: str, stamp: Time, position_m: float = 0.0, yaw_rad: float = 0.0
) -> PoseWithCovarianceStamped:
    """position_m, yaw_rad: standard deviations; without them localization has its own for a start."""
    message = PoseWithCovarianceStamped()
    message.header.frame_id, message.header.stamp, message.pose.pose = frame_id, stamp, pose_to_msg(pose)
    message.pose.covariance[0] = message.pose.covariance[7] = position_m**2
    message.pose.covariance[35] = yaw_rad**2
    return message


def transform_stamped(pose: Pose2, parent: str, child: str, stamp: Time, z_m: float = 0.0) -> TransformStamped:
    """The transform that maps coordinates in ``child`` to coordinates in ``parent``."""
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id, message.header.stamp = parent, stamp
    translation = message.transform.translation
    translation.x, translation.y, translation.z = float(pose.x), float(pose.y), float(z_m)
    message.transform.rotation = quaternion_to_msg(pose.yaw)
    return message


def camera_info(calibrated: Intrinsics) -> CameraInfo:
    """Without frame and stamp. Images are not rectified."""
    k = calibrated.matrix()
    return CameraInfo(
        height=calibrated.height,
        width=calibrated.width,
        distortion_model="plumb_bob",
        d=list(calibrated.distortion),
        k=k.ravel().tolist(),
        r=np.eye(3).ravel().tolist(),
        p=np.c_[k, np.zeros(3)].ravel().tolist(),
    )
