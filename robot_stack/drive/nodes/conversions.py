"""Conversions between the drive's messages and the values of its kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from nav_msgs.msg import Odometry as OdometryMessage
from sensor_msgs.msg import JointState

from custom_msgs.msg import SwerveModuleCommand, SwerveModuleCommandArray, VelocityLimit
from robot_stack.contract import frames
from robot_stack.contract.faults import split_codes
from robot_stack.core.geometry import Pose2, covariance_of_message
from robot_stack.core.limits import SafetyLimit
from robot_stack.core.robot import Robot
from robot_stack.drive.kinematics import ModuleSetPoints
from robot_stack.drive.odometry import Encoders, Odometry
from robot_stack.middleware.conversions import pose_to_msg, transform_stamped, twist_to_msg
from robot_stack.wmx.axes import StatusSnapshot
from tf2_msgs.msg import TFMessage


def wheel_commands(modules: ModuleSetPoints, stamp: Time) -> SwerveModuleCommandArray:
    pairs = zip(modules.speeds_mps, modules.angles_rad, strict=True)
    message = SwerveModuleCommandArray(
        modules=[
            SwerveModuleCommand(module_id=module, drive_velocity=speed, steering_angle=angle)
            for module, (speed, angle) in enumerate(pairs)
        ]
    )
    message.header.stamp, message.header.frame_id = stamp, frames.BASE_LINK
    return message


def joint_states(
    snapshot: StatusSnapshot, axes: Sequence[int], nm_per_percent: Sequence[float], stamp: Time
) -> JointState:
    """axes: the engine's, by joint. nm_per_percent: torque per percent of the axis' rated torque, by joint."""
    message = JointState(name=list(frames.JOINTS))
    message.header.stamp, message.header.frame_id = stamp, frames.BASE_LINK
    index = list(axes)
    message.position = snapshot.actual_pos[index].tolist()
    message.velocity = snapshot.actual_velocity[index].tolist()
    percent = snapshot.actual_torque[index].tolist()
    message.effort = [share * torque for share, torque in zip(percent, nm_per_percent, strict=True)]
    return message


def odometry_message(odometry: Odometry, stamp: Time) -> OdometryMessage:
    message = OdometryMessage(child_frame_id=frames.BASE_LINK)
    message.header.stamp, message.header.frame_id = stamp, frames.ODOM
    message.pose.pose = pose_to_msg(odometry.pose)
    message.pose.covariance = covariance_of_message(odometry.pose_covariance)
    message.twist.twist = twist_to_msg(odometry.twist)
    message.twist.covariance = covariance_of_message(odometry.twist_covariance)
    return message


class DriveTransforms:
    """odom -> base_link, and the frames of each module in base_link: steering and wheel."""

    def __init__(self, robot: Robot) -> None:
        still = Time()
        self._steering, self._wheels = [], []
        for module, (x, y) in zip(frames.MODULES, robot.module_positions_m(), strict=True):
            steering, axle = frames.steering_link(module), Pose2(x, y, 0.0)
            self._steering.append(transform_stamped(axle, frames.BASE_LINK, steering, still, robot.wheel_radius_m))
            self._wheels.append(transform_stamped(Pose2(0.0, 0.0, 0.0), steering, frames.wheel_link(module), still))

    def message(self, odometry: Odometry, joints: Encoders, stamp: Time) -> TFMessage:
        """Valid until the next call, which changes its transforms of the modules."""
        for transform, angle_rad in zip(self._steering, joints.steer_rad, strict=True):
            transform.header.stamp, rotation = stamp, transform.transform.rotation
            rotation.z, rotation.w = math.sin(0.5 * angle_rad), math.cos(0.5 * angle_rad)
        for transform, angle_rad in zip(self._wheels, joints.drive_rad, strict=True):
            transform.header.stamp, rotation = stamp, transform.transform.rotation
            rotation.y, rotation.w = math.sin(0.5 * angle_rad), math.cos(0.5 * angle_rad)
        base = transform_stamped(odometry.pose, frames.ODOM, frames.BASE_LINK, stamp)
        return TFMessage(transforms=[base, *self._steering, *self._wheels])


def speed_limit(message: VelocityLimit | None) -> SafetyLimit | None:
    if message is None:
        return None
    return SafetyLimit(message.max_linear_velocity, message.max_angular_velocity, split_codes(message.reason))
