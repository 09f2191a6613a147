"""Reads the data of a map from a recording: MCAP of the recorder, or any rosbag2."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robot_stack.cli.errors import WRONG_USE, CommandError
from robot_stack.cli.recordings import Recorded, read_all, recording_files
from robot_stack.contract import topics
from robot_stack.core.config import read_yaml
from robot_stack.core.geometry import planar_pose, tilt_from_quaternion
from robot_stack.core.point_cloud import SWEEP, Points
from robot_stack.core.robot import Robot
from robot_stack.mapping.collector import Collector
from robot_stack.mapping.params import Sweeps
from robot_stack.mapping.ride import Ride, RideError

TOPICS = (topics.LIDAR_POINTS.name, topics.ODOM.name, topics.IMU.name)
# sensor_msgs/msg/PointField
_TYPES = {7: "<f4", 8: "<f8", 4: "<u2", 2: "<u1", 6: "<u4"}


def read_ride(
    path: Path, settings: Sweeps, robot: Robot, progress: Callable[[int, int], None]
) -> tuple[Ride, list[str]]:
    """(the ride, errors of the files). progress: called with (bytes read, total bytes). Raises CommandError."""
    collector = Collector(settings, robot)
    warnings: list[str] = []
    counts = dict.fromkeys(TOPICS, 0)
    for item in messages(path, TOPICS, progress):
        if isinstance(item, str):
            warnings.append(item)
            continue
        counts[item.topic] += 1
        try:
            feed(collector, item)
        except ValueError as error:
            raise CommandError(f"{path}: {item.topic}: {error}") from None
    silent = [topic for topic in (topics.LIDAR_POINTS.name, topics.ODOM.name) if not counts[topic]]
    damage = f"; {warnings[0]}" if warnings else ""
    if silent:
        raise CommandError(f"{path}: no message on {' and '.join(silent)}{damage}")
    if not counts[topics.IMU.name]:
        warnings.append(f"{path}: no message on {topics.IMU.name}: slopes and the gyro are missing")
    if collector.restarts_s:
        times = ", ".join(f"{stamp_s:.1f} s" for stamp_s in collector.restarts_s)
        warnings.append(
            f"{path}: odometry restarted at {times}: the motion meanwhile is unknown; "
            "look for doubled walls there, and drive again if there are any"
        )
    try:
        return collector.finish(), warnings
    except RideError as error:
        raise CommandError(f"{path}: {error}{damage}") from None


def messages(path: Path, names: Collection[str], progress: Callable[[int, int], None]) -> Iterator[Recorded | str]:
    """Messages of the topics ``names``, and errors of the files as text. Raises CommandError."""
    if _is_sqlite(path):
        yield from _rosbag(path, names, progress)
        return
    yield from read_all(recording_files(path), names, progress)


def _is_sqlite(path: Path) -> bool:
    return path.suffix == ".db3" or (path.is_dir() and any(path.glob("*.db3")))


def _rosbag(path: Path, names: Collection[str], progress: Callable[[int, int], None]) -> Iterator[Recorded | str]:
    """A rosbag2 in SQLite."""
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    folder = path if path.is_dir() else path.parent
    read_yaml(folder / "metadata.yaml")
    try:
        with AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            wanted = [connection for connection in reader.connections if connection.topic in names]
            total = sum(connection.msgcount for connection in wanted)
            for done, (connection, at_ns, data) in enumerate(reader.messages(wanted) if wanted else (), 1):
                yield Recorded(connection.topic, 1e-9 * at_ns, partial(reader.deserialize, data, connection.msgtype))
                progress(done, total)
    except (AnyReaderError, OSError) as error:
        raise CommandError(f"{path} cannot be read as a rosbag2: {error}", WRONG_USE) from None
    except Exception as error:  # rosbags has no common base class for errors of damaged files
        yield f"{path} is damaged ({type(error).__name__}: {error})"


def feed(collector: Collector, item: Recorded) -> None:
    """Processes one message of ``TOPICS``. Raises ValueError for an invalid cloud."""
    message = item.decode()
    stamp_s = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
    if item.topic == topics.ODOM.name:
        pose = planar_pose(message.pose.pose.position, message.pose.pose.orientation)
        covariance = message.pose.covariance
        collector.odometry(stamp_s, pose.x, pose.y, pose.yaw, float(covariance[0] + covariance[7] + covariance[35]))
    elif item.topic == topics.IMU.name:
        # REP 145: -1 in the first element of the covariance means no orientation.
        there = message.orientation_covariance[0] != -1.0
        q = message.orientation
        roll, pitch = tilt_from_quaternion(q.x, q.y, q.z, q.w) if there else (math.nan, math.nan)
        collector.imu(stamp_s, roll, pitch, message.angular_velocity.z)
    else:
        collector.sweep(stamp_s, points_of(message))


def points_of(message: Any) -> Points:
    """(n,) of layout SWEEP from a decoded PointCloud2. Raises ValueError for missing fields or bytes."""
    found = {field.name: field for field in message.fields}
    data = np.frombuffer(bytes(message.data), np.uint8)
    count, step = message.width * message.height, message.point_step
    if step == 0 or len(data) != count * step or message.is_bigendian:
        raise ValueError(f"{len(data)} bytes are not {count} little-endian points of {step} bytes")
    points = np.zeros(count, SWEEP)
    assert SWEEP.names is not None
    for name in ("x", "y", "z", "time"):
        field = found.get(name)
        if field is None:
            raise ValueError(f"field {name} is missing; there are {', '.join(found) or 'none'}")
        if field.datatype not in _TYPES:
            raise ValueError(f"field {name} is of type {field.datatype}, not a number that can be read")
        layout = np.dtype(
            {"names": [name], "formats": [_TYPES[field.datatype]], "offsets": [field.offset], "itemsize": step}
        )
        points[name] = data.view(layout)[name]
    return points
