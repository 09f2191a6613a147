"""Sensor readings of a simulation without ROS, written in the recorder's format."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore

from robot_stack.contract import frames, topics
from robot_stack.contract.frames import DRIVE_AXES, JOINTS, STEER_AXES
from robot_stack.contract.model import Topic
from robot_stack.core.geometry import quaternion_from_yaw
from robot_stack.core.point_cloud import Points
from robot_stack.drive.odometry import Encoders, Odometry
from robot_stack.recording.writer import BagWriter, Format, topic_info
from sim.plant.imu import ImuSample

_IMAGES = {frames.FRONT_CAMERA: topics.FRONT_IMAGE, frames.REAR_CAMERA: topics.REAR_IMAGE}
_ROWS = (topics.LIDAR_POINTS, topics.ODOM, topics.IMU, topics.JOINT_STATES, *_IMAGES.values())
# Any day: simulated time counts from here.
_EPOCH_NS = 1_750_000_000_000_000_000
_FORM = Format(split_bytes=1_000_000_000, chunk_bytes=1_000_000, compress=True)
_FLOAT32, _UINT16 = 7, 4  # of sensor_msgs/msg/PointField


class RideWriter:
    """A recording in ``folder``, which must not exist. Raises OSError."""

    def __init__(self, folder: Path) -> None:
        self._bag = BagWriter(folder, [topic_info(row) for row in _ROWS], _FORM)
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._types = self._store.types

    def __enter__(self) -> RideWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self._bag.close()

    def odometry(self, stamp_s: float, odometry: Odometry) -> None:
        t = self._types
        pose, twist = odometry.pose, odometry.twist
        place = t["geometry_msgs/msg/Point"](pose.x, pose.y, 0.0)
        turn = t["geometry_msgs/msg/Quaternion"](*quaternion_from_yaw(pose.yaw))
        vector = t["geometry_msgs/msg/Vector3"]
        with_covariance = t["geometry_msgs/msg/PoseWithCovariance"]
        twist_with_covariance = t["geometry_msgs/msg/TwistWithCovariance"]
        message = t["nav_msgs/msg/Odometry"](
            header=self._header(stamp_s, frames.ODOM),
            child_frame_id=frames.BASE_LINK,
            pose=with_covariance(t["geometry_msgs/msg/Pose"](place, turn), np.zeros(36)),
            twist=twist_with_covariance(
                t["geometry_msgs/msg/Twist"](vector(twist.vx, twist.vy, 0.0), vector(0.0, 0.0, twist.omega)),
                np.zeros(36),
            ),
        )
        self._write(topics.ODOM, stamp_s, message)

    def joint_states(self, encoders: Encoders) -> None:
        """Positions only."""
        positions = np.zeros(len(JOINTS))
        positions[list(DRIVE_AXES)], positions[list(STEER_AXES)] = encoders.drive_rad, encoders.steer_rad
        nothing = np.zeros(0)
        header = self._header(encoders.stamp_s, "")
        message = self._types["sensor_msgs/msg/JointState"](header, list(JOINTS), positions, nothing, nothing)
        self._write(topics.JOINT_STATES, encoders.stamp_s, message)

    def imu(self, sample: ImuSample) -> None:
        t = self._types
        vector = t["geometry_msgs/msg/Vector3"]
        message = t["sensor_msgs/msg/Imu"](
            header=self._header(sample.time_s, frames.IMU),
            orientation=t["geometry_msgs/msg/Quaternion"](*sample.orientation_xyzw),
            orientation_covariance=np.zeros(9),
            angular_velocity=vector(*sample.rotation_radps),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=vector(*sample.acceleration_mps2),
            linear_acceleration_covariance=np.zeros(9),
        )
        self._write(topics.IMU, sample.time_s, message)

    def sweep(self, stamp_s: float, points: Points) -> None:
        """(n,) of layout SWEEP, frame lidar."""
        layout = points.dtype
        assert layout.fields is not None
        field = self._types["sensor_msgs/msg/PointField"]
        fields = [
            field(name, described[1], _UINT16 if described[0] == np.uint16 else _FLOAT32, 1)
            for name, described in layout.fields.items()
        ]
        message = self._types["sensor_msgs/msg/PointCloud2"](
            header=self._header(stamp_s, frames.LIDAR),
            height=1,
            width=len(points),
            fields=fields,
            is_bigendian=False,
            point_step=layout.itemsize,
            row_step=points.nbytes,
            data=np.ascontiguousarray(points).view(np.uint8),
            is_dense=True,
        )
        self._write(topics.LIDAR_POINTS, stamp_s, message)

    def image(self, stamp_s: float, frame: str, picture: NDArray[np.uint8]) -> None:
        """(height, width) grey levels of the camera ``frame``."""
        height, width = picture.shape
        header = self._header(stamp_s, frame)
        data = np.ascontiguousarray(picture).ravel()
        message = self._types["sensor_msgs/msg/Image"](header, height, width, "mono8", 0, width, data)
        self._write(_IMAGES[frame], stamp_s, message)

    def _header(self, stamp_s: float, frame: str) -> Any:
        at_ns = _EPOCH_NS + round(1e9 * stamp_s)
        stamp = self._types["builtin_interfaces/msg/Time"](at_ns // 10**9, at_ns % 10**9)
        return self._types["std_msgs/msg/Header"](stamp, frame)

    def _write(self, row: Topic, stamp_s: float, message: Any) -> None:
        at_ns = _EPOCH_NS + round(1e9 * stamp_s)
        self._bag.write(row.name, at_ns, at_ns, bytes(self._store.serialize_cdr(message, row.type)))
