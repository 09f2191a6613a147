"""Converts between the messages of navigation and the values of its kernels."""

from __future__ import annotations

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2

from custom_msgs.msg import BuildingRequest, BuildingState
from robot_stack.contract import frames, topics
from robot_stack.core.geometry import Pose2
from robot_stack.core.people import Person, people_of
from robot_stack.core.point_cloud import PEOPLE
from robot_stack.middleware.conversions import pose_stamped, time_to_s
from robot_stack.middleware.point_cloud import points_of
from robot_stack.navigation.doors import DoorRequest, DoorState
from robot_stack.navigation.goal import GoalRequest
from robot_stack.navigation.path import Path


def goal_request(message: PoseStamped) -> GoalRequest:
    p, q = message.pose.position, message.pose.orientation
    return GoalRequest(message.header.frame_id, time_to_s(message.header.stamp), (p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def building_request(request: DoorRequest, requester: str, stamp: Time) -> BuildingRequest:
    message = BuildingRequest(name=request.name, requester=requester, passage=request.passage)
    message.header.stamp, message.mode, message.phase = stamp, int(request.mode), int(request.phase)
    return message


def door_state(message: BuildingState, requester: str) -> DoorState:
    stamp_s = time_to_s(message.header.stamp)
    return DoorState(message.name, message.mode, requester in message.sessions, stamp_s)


def costmap_cells(message: OccupancyGrid) -> NDArray[np.int8]:
    """(rows, columns). Raises ValueError, with the topic's name, for another frame and for data of another size."""
    height, width = message.info.height, message.info.width
    cells = np.frombuffer(message.data, np.int8)
    if message.header.frame_id != frames.ODOM:
        raise ValueError(
            f"{topics.LOCAL_COSTMAP.name} frame_id is {message.header.frame_id!r}, must be {frames.ODOM!r}"
        )
    if cells.size != height * width:
        raise ValueError(f"{topics.LOCAL_COSTMAP.name} data has {cells.size} cells, must be {height} x {width}")
    return cells.reshape(height, width)


def people_in(message: PointCloud2) -> tuple[Person, ...]:
    """In odom. Raises ValueError, with the topic's name, for another frame, layout or values that are not finite."""
    name = topics.PEOPLE.name
    if message.header.frame_id != frames.ODOM:
        raise ValueError(f"{name} frame_id is {message.header.frame_id!r}, must be {frames.ODOM!r}")
    try:
        return people_of(points_of(message, PEOPLE), time_to_s(message.header.stamp))
    except ValueError as error:
        raise ValueError(f"{name} {error}") from error


def path_message(path: Path | None, stamp: Time) -> PathMessage:
    """In map; without poses where there is no path."""
    poses = [] if path is None else [Pose2(*map(float, row)) for row in path.poses]
    message = PathMessage(poses=[pose_stamped(pose, frames.MAP, stamp) for pose in poses])
    message.header.frame_id, message.header.stamp = frames.MAP, stamp
    return message
