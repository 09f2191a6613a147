"""Obstacles from the overhead LiDAR: near the robot, and where the wheelchair hides them from the spinning LiDAR."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from robot_stack.contract import frames
from robot_stack.core.geometry import Pose2
from robot_stack.core.point_cloud import Points
from robot_stack.core.robot import Robot
from robot_stack.perception.crop import UPRIGHT
from robot_stack.perception.deskew import Motion
from robot_stack.perception.mixed_pixels import ChairEdges
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.sensor_view import SensorView
from robot_stack.perception.space.view import View
from robot_stack.perception.voxel import raised, voxels
from robot_stack.perception.weather_filter import crowd_of

Float = NDArray[np.float32]
_NOTHING: Float = np.empty((0, 3), np.float32)


class Overhead:
    """The newest frame's obstacles, moved by the robot's motion since."""

    def __init__(self, robot: Robot, params: PerceptionParams, motion: Motion) -> None:
        self._params, self._motion = params, motion
        sensor = robot.range_sensors[frames.OVERHEAD_LIDAR]
        # A point within range_m of base_link is no farther from the sensor than this.
        near_m = params.overhead.range_m + math.hypot(*sensor.xyz_m)
        wide_m = params.fast_bodies.space(params.space).reach_m
        self._view = SensorView(
            robot, params, frames.OVERHEAD_LIDAR, (sensor.min_m, min(sensor.max_m, wide_m)), robot.mast
        )
        self._near_reach_m = min(near_m, params.space.reach_m)
        self._views = self._view.views(wide_m, self._near_reach_m)
        spacing_rad = (sensor.ring_spacing_rad, math.radians(sensor.span_deg) / sensor.columns)
        self._chair_edges = ChairEdges(self._view.mount, self._view.turned, self._view.cut[True][-1], spacing_rad)
        self._crowd = crowd_of(sensor, params.obstacles, 0.5 * params.fast_bodies.size_m)
        self._stamp_s = -math.inf
        self._obstacles = _NOTHING

    def forget(self) -> None:
        self._stamp_s, self._obstacles = -math.inf, _NOTHING

    def take(self, points: Points, stamp_s: float, chair: bool, lean: Float = UPRIGHT) -> View:
        """A frame: points (n,) in the sensor's frame, m, times relative to the stamp, s. Needs the motion there.
        lean: of an attached chair, see ``UPRIGHT``.

        Returns its view for the model of the space: without the obstacles beside the chair, see ``mixed``.
        """
        xyz, _ = self._view.points(points, stamp_s, self._motion, chair, lean)
        seen = self._view.segment(xyz, self._motion.attitude_at(stamp_s))
        found = raised(seen.xyz, seen.labels)
        things, _ = self._crowd.split(found)
        if chair:
            self._chair_edges.look(points, lean)
            filter_params = self._params.mixed_pixels
            things = self._chair_edges.without_sparse(things, filter_params, filter_params.overhead_points_min)
        centroids = voxels(things, self._params.obstacles.voxel_m)
        near = np.hypot(centroids[:, 0], centroids[:, 1]) <= self._params.overhead.range_m
        self._obstacles, self._stamp_s = centroids[near], stamp_s
        look = self._views.view(stamp_s, seen.sensor_m, seen.tilt, centroids, seen.points, seen.profile)
        if chair:
            look = self._chair_edges.without(look)
        return replace(look, specks=found, looked_s=self._view.looked_s(points))

    def near(self, look: View) -> View:
        """A view for the first grid: beyond ``range_m`` returns are too sparse to follow a body of walking speed."""
        return look.within(self._params.overhead.range_m, self._near_reach_m)

    def at(self, stamp_s: float) -> Float:
        """(k, 3) base_link at the stamp; none from a frame that is older than ``keep_s``."""
        if not abs(stamp_s - self._stamp_s) <= self._params.overhead.keep_s or not len(self._obstacles):
            return _NOTHING
        step = self._motion.pose_at(self._stamp_s).relative_to(self._motion.pose_at(stamp_s))
        return moved(self._obstacles, step)


def moved(xyz: Float, step: Pose2) -> Float:
    """(n, 3) of a frame at ``step``, in the frame that ``step`` is given in."""
    c, s = math.cos(step.yaw), math.sin(step.yaw)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]], np.float32)
    found: Float = xyz @ turn + np.array([step.x, step.y, 0.0], np.float32)
    return found
