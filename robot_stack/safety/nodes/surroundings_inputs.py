"""What the safety monitor hears of the robot's surroundings and of where it is told to go."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from sensor_msgs.msg import PointCloud2

from robot_stack.contract import frames, topics
from robot_stack.core.point_cloud import XYZ, Points, xyz_of
from robot_stack.ros.conversions import pose_from_msg, time_to_s, twist_from_msg
from robot_stack.ros.node import StackNode
from robot_stack.ros.point_cloud import points_of
from robot_stack.safety.observation import Observation


class SurroundingsInputs:
    """Subscriptions of the node ``safety_monitor``.

    observation: gives the one in force, which a start under /clock renews. sample: points of a sweep to look at.
    """

    def __init__(self, node: StackNode, observation: Callable[[], Observation], sample: int) -> None:
        self._node, self._observation, self._sample = node, observation, sample
        node.subscribe(topics.LIDAR_POINTS, self._on_sweep)
        node.subscribe(topics.OBSTACLES, self._on_obstacles)
        node.subscribe(topics.DOCKING_TARGET, self._on_dock)
        node.subscribe(topics.CMD_VEL_LIMITED, self._on_limited)
        node.subscribe(topics.CMD_VEL, partial(self._on_wish, topics.CMD_VEL.name))
        for row in (topics.DOCKING_CMD_VEL, topics.TELEOP_CMD_VEL):
            node.subscribe(row, partial(self._on_stamped_wish, row.name))

    def _on_sweep(self, message: PointCloud2) -> None:
        lidar = self._observation().lidar
        try:
            points = points_of(message, XYZ)
        except ValueError as error:
            lidar.refused(str(error))
            return
        # One point of each block of them, at a place that differs from block to block: a fixed stride would pick the
        # same few rings out of a sweep whose rings take turns.
        block = max(len(points) // self._sample, 1)
        starts = np.arange(0, len(points) - block + 1, block)
        chosen = points[starts + np.arange(len(starts)) % block]
        lidar.received(_columns(chosen), len(points), self._node.steady_s())

    def _on_obstacles(self, message: PointCloud2) -> None:
        observation = self._observation()
        try:
            points = points_of(message, XYZ)
        except ValueError as error:
            observation.surroundings.refused(str(error))
            return
        if message.header.frame_id != frames.BASE_LINK:
            observation.surroundings.refused(f"frame_id is {message.header.frame_id!r}, must be {frames.BASE_LINK!r}")
            return
        observation.obstacles(xyz_of(_packed(points)), self._latency_s(message), self._node.steady_s())

    def _on_dock(self, message: PoseStamped) -> None:
        if message.header.frame_id == frames.BASE_LINK:
            pose, now_s = pose_from_msg(message.pose), self._node.steady_s()
            self._observation().surroundings.dock(pose, self._latency_s(message), now_s)

    def _on_limited(self, message: TwistStamped) -> None:
        self._observation().commands.limited(twist_from_msg(message.twist), self._node.steady_s())

    def _on_stamped_wish(self, source: str, message: TwistStamped) -> None:
        self._on_wish(source, message.twist)

    def _on_wish(self, source: str, message: Twist) -> None:
        self._observation().commands.wish(source, twist_from_msg(message), self._node.steady_s())

    def _latency_s(self, message: PointCloud2 | PoseStamped) -> float:
        return self._node.now_s() - time_to_s(message.header.stamp)


def _columns(points: Points) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """(n, 3) copy of x, y, z."""
    return np.stack([points["x"], points["y"], points["z"]], axis=1)


def _packed(points: Points) -> Points:
    """The same points without the other fields that a message may have between them."""
    return points if points.dtype == XYZ else points.astype(XYZ)
