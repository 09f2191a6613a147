"""Conversions between localization messages and the values of its kernels."""

from __future__ import annotations

from array import array

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import Imu, PointCloud2

from robot_stack.contract import frames
from robot_stack.core.geometry import Pose2
from robot_stack.core.point_cloud import SWEEP, Points, points_from_xyz
from robot_stack.core.site_map import Cells, Grid
from robot_stack.localization.filter import Array
from robot_stack.localization.gyro import ImuSample
from robot_stack.localization.localizer import PLANAR
from robot_stack.localization.odometry import OdometryReading, Variances
from robot_stack.middleware.conversions import pose_from_msg, pose_to_msg, time_to_s, twist_from_msg
from robot_stack.middleware.point_cloud import cloud_message, points_of
from robot_stack.middleware.wire import CloudView


def map_grid(grid: Grid, stamp: Time) -> OccupancyGrid:
    message = OccupancyGrid()
    message.header.frame_id = frames.MAP
    message.header.stamp = message.info.map_load_time = stamp
    message.info.resolution = grid.resolution_m
    message.info.height, message.info.width = grid.occupancy.shape
    message.info.origin.position.x, message.info.origin.position.y = grid.origin_x_m, grid.origin_y_m
    message.info.origin.orientation.w = 1.0
    message.data = array("b", grid.occupancy.tobytes())
    return message


def map_cloud(cells: Cells, stamp: Time) -> PointCloud2:
    """The mean of each cell's points."""
    message = cloud_message(points_from_xyz(cells.mean), frames.MAP)
    message.header.stamp = stamp
    return message


def imu_sample(message: Imu) -> ImuSample:
    rate, acceleration = message.angular_velocity, message.linear_acceleration
    signature = (rate.x, rate.y, rate.z, acceleration.x, acceleration.y, acceleration.z)
    return ImuSample(time_to_s(message.header.stamp), rate.z, signature)


def up_of(message: Imu) -> Array | None:
    """(3,) the unit vector upwards in base_link; None from an IMU without an orientation."""
    if not message.orientation_covariance[0] >= 0.0:  # negative: no orientation
        return None
    q = message.orientation
    up = (2.0 * (q.x * q.z - q.w * q.y), 2.0 * (q.y * q.z + q.w * q.x), 1.0 - 2.0 * (q.x * q.x + q.y * q.y))
    return np.array(up)


def odometry_reading(message: Odometry) -> OdometryReading:
    return OdometryReading(
        time_to_s(message.header.stamp),
        pose_from_msg(message.pose.pose),
        twist_from_msg(message.twist.twist),
        _planar_variances(message.pose.covariance),
        _planar_variances(message.twist.covariance),
    )


def _planar_variances(covariance: list[float]) -> Variances:
    """(x, y, yaw) of the diagonal of a row-major (6, 6) covariance."""
    return float(covariance[0]), float(covariance[7]), float(covariance[35])


def sweep_of(message: CloudView) -> Points:
    """The points, without a copy if laid out as ``SWEEP``. Raises ValueError for another message."""
    sweep = points_of(message, SWEEP)
    same_layout = sweep.dtype.fields == SWEEP.fields and sweep.dtype.itemsize == SWEEP.itemsize
    return sweep if same_layout else sweep.astype(SWEEP)


def given_pose(message: PoseWithCovarianceStamped) -> tuple[Pose2, str]:
    """The pose and why it cannot be used; an empty text if it can."""
    pose = pose_from_msg(message.pose.pose)
    q = message.pose.pose.orientation
    norm2 = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w
    if message.header.frame_id != frames.MAP:
        return pose, f"frame_id is {message.header.frame_id!r}, must be {frames.MAP!r}"
    if not pose.is_finite():
        return pose, f"pose is not finite: x {pose.x}, y {pose.y}, yaw {pose.yaw}"
    if not abs(norm2 - 1.0) < 0.01:
        return pose, f"orientation is no unit quaternion, its squared norm is {norm2:.3f}"
    return pose, ""


def pose_with_covariance(pose: Pose2, covariance: Array, stamp: Time) -> PoseWithCovarianceStamped:
    """covariance: (3, 3) of x, y, yaw; height, roll and pitch are not estimated and stay 0."""
    message = PoseWithCovarianceStamped()
    message.header.frame_id, message.header.stamp = frames.MAP, stamp
    message.pose.pose = pose_to_msg(pose)
    whole = np.zeros((6, 6))
    whole[np.ix_(PLANAR, PLANAR)] = covariance
    message.pose.covariance = whole.ravel()
    return message
