"""Inputs of the safety monitor from the robot's surroundings and of its commands."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial

import numpy as np
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped

from robot_stack.contract import frames, topics
from robot_stack.core.point_cloud import MOVING, XYZ, Points, rows_of, xyz_of
from robot_stack.middleware.conversions import pose_from_msg, time_to_s, twist_from_msg
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.point_cloud import points_of
from robot_stack.middleware.wire import CloudView
from robot_stack.safety.lidar_watch import LidarWatch
from robot_stack.safety.observation import Observation
from robot_stack.safety.params import SafetyParams


class SurroundingsInputs:
    """Subscriptions of the node ``safety_monitor``.

    observation: returns the present one, which a start under /clock replaces.
    """

    def __init__(self, node: StackNode, observation: Callable[[], Observation], params: SafetyParams) -> None:
        self._node, self._observation = node, observation
        spinning, overhead = params.lidar.sample, params.overhead_lidar.sample
        node.subscribe(topics.LIDAR_POINTS, lambda message: self._on_sweep(message, observation().lidar, spinning))
        node.subscribe(
            topics.OVERHEAD_LIDAR_POINTS,
            lambda message: self._on_sweep(message, observation().overhead_lidar, overhead),
        )
        node.subscribe(topics.OBSTACLES, self._on_obstacles)
        node.subscribe(topics.UNSEEN_SPACE, self._on_unseen)
        node.subscribe(topics.NO_GROUND, self._on_no_ground)
        node.subscribe(topics.MOVING, self._on_moving)
        node.subscribe(topics.DOCKING_TARGET, self._on_dock)
        node.subscribe(topics.CMD_VEL_LIMITED, self._on_limited)
        node.subscribe(topics.CMD_VEL, partial(self._on_command, topics.CMD_VEL.name))
        for row in (topics.DOCKING_CMD_VEL, topics.TELEOP_CMD_VEL):
            node.subscribe(row, partial(self._on_stamped_command, row.name))

    def _on_sweep(self, message: CloudView, lidar: LidarWatch, sample: int) -> None:
        try:
            points = points_of(message, XYZ)
        except ValueError as error:
            lidar.refused(str(error))
            return
        # One point of each block, at an index that differs from block to block: a fixed stride would pick the same
        # few rings of a sweep with interleaved rings.
        block = max(len(points) // sample, 1)
        starts = np.arange(0, len(points) - block + 1, block)
        chosen = points[starts + np.arange(len(starts)) % block]
        lidar.received(_columns(chosen), len(points), self._node.steady_s())

    def _on_obstacles(self, message: CloudView) -> None:
        observation = self._observation()
        try:
            points = _of_base_link(message)
        except ValueError as error:
            observation.surroundings.refused(str(error))
            return
        observation.obstacles(points, self._latency_s(message), self._node.steady_s())

    def _on_unseen(self, message: CloudView) -> None:
        """An invalid cloud counts as not received: then the whole way is unseen."""
        with suppress(ValueError):
            points, around = _of_base_link(message), self._observation().surroundings
            around.unseen_received(points, self._latency_s(message), self._node.steady_s())

    def _on_no_ground(self, message: CloudView) -> None:
        """A message that is not such a cloud counts as not received: then no ground is known ahead."""
        with suppress(ValueError):
            points, around = _of_base_link(message), self._observation().surroundings
            around.no_ground_received(points, self._latency_s(message), self._node.steady_s())

    def _on_moving(self, message: CloudView) -> None:
        """An invalid cloud counts as not received: then moving bodies are unknown."""
        with suppress(ValueError):
            rows = rows_of(_points_of_base_link(message, MOVING))
            self._observation().surroundings.moving_received(rows, self._latency_s(message), self._node.steady_s())

    def _on_dock(self, message: PoseStamped) -> None:
        if message.header.frame_id == frames.BASE_LINK:
            pose, now_s = pose_from_msg(message.pose), self._node.steady_s()
            self._observation().surroundings.dock(pose, self._latency_s(message), now_s)

    def _on_limited(self, message: TwistStamped) -> None:
        self._observation().commands.limited(twist_from_msg(message.twist), self._node.steady_s())

    def _on_stamped_command(self, source: str, message: TwistStamped) -> None:
        self._on_command(source, message.twist)

    def _on_command(self, source: str, message: Twist) -> None:
        self._observation().commands.request(source, twist_from_msg(message), self._node.steady_s())

    def _latency_s(self, message: CloudView | PoseStamped) -> float:
        return self._node.now_s() - time_to_s(message.header.stamp)


def _columns(points: Points) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """(n, 3) copy of x, y, z."""
    return np.stack([points["x"], points["y"], points["z"]], axis=1)


def _of_base_link(message: CloudView) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """(n, 3) points of a cloud in base_link. Raises ValueError saying what it is instead."""
    return xyz_of(_packed(_points_of_base_link(message, XYZ)))


def _points_of_base_link(message: CloudView, layout: np.dtype[np.void]) -> Points:
    points = points_of(message, layout)
    if message.header.frame_id != frames.BASE_LINK:
        raise ValueError(f"frame_id is {message.header.frame_id!r}, must be {frames.BASE_LINK!r}")
    return points


def _packed(points: Points) -> Points:
    """The same points without the other fields that a message may have between them."""
    return points if points.dtype == XYZ else points.astype(XYZ)
