"""The stages from a sweep to obstacles and the model of the space, in their order."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_stack.contract import frames
from robot_stack.core.geometry import Pose2
from robot_stack.core.people import Person
from robot_stack.core.point_cloud import Points
from robot_stack.core.robot import Robot
from robot_stack.perception import ground
from robot_stack.perception.carry import carried
from robot_stack.perception.crop import UPRIGHT
from robot_stack.perception.deskew import Attitude, Motion
from robot_stack.perception.mixed_pixels import ChairEdges
from robot_stack.perception.overhead import Overhead
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.sensor_view import Segmented, SensorView
from robot_stack.perception.space.footing import Footing
from robot_stack.perception.space.kernels import OCCUPIED
from robot_stack.perception.space.moving_objects import MovingObjects
from robot_stack.perception.space.people import People
from robot_stack.perception.space.space import Space, SpaceGrid
from robot_stack.perception.space.view import View
from robot_stack.perception.voxel import raised, voxels
from robot_stack.perception.watch import DIRECTIONS
from robot_stack.perception.weather_filter import crowd_of

Float = NDArray[np.float32]
_NOTHING: Float = np.empty((0, 3), np.float32)
# An edge this near to one of the last half sweeps is the same: its place is known up to the next ring.
_SAME_EDGE_M, _HALF_SWEEPS = 0.3, 4


@dataclass(frozen=True, slots=True)
class Scene:
    """Points (n, 3) in base_link at stamp_s: obstacles, observed and stored; unseen: where known space ends;
    no_ground: where known footing ends.

    moving: (n, 5) points of moving objects and their velocity over ground in base_link's axes: x, y, z, vx, vy.
    """

    stamp_s: float
    obstacles: Float
    unseen: Float
    no_ground: Float
    moving: Float
    broken: int


class Trackers(NamedTuple):
    """Of one sensor: two sensors observe different sides of an object. fast: in the wide grid.
    slow: of bodies too slow for ``walking``, while the robot stands."""

    slow: MovingObjects
    walking: MovingObjects
    fast: MovingObjects


class Pipeline:
    """Everything but the inputs' health. The motion must be known at the given stamps."""

    def __init__(self, robot: Robot, params: PerceptionParams) -> None:
        self._robot, self._params = robot, params
        self.motion = Motion(params.deskew)
        self._restarts = 0
        range_m = (params.crop.range_min_m, params.crop.range_max_m)
        self._view = SensorView(robot, params, frames.LIDAR, range_m)
        self._mount = self._view.mount
        self._crowd = crowd_of(robot.range_sensors[frames.LIDAR], params.obstacles, params.obstacles.range_m)
        all_heights = (math.pi, 2.0 * math.pi / DIRECTIONS)
        self._chair_edges = ChairEdges(self._view.mount, self._view.turned, self._view.cut[True][-1], all_heights)
        self._outlines = {chair: self._outline(chair) for chair in (False, True)}
        self._last: tuple[float, Float] | None = None
        self._past_edges: deque[NDArray[np.float64]] = deque(maxlen=_HALF_SWEEPS)
        wide = params.fast_bodies.space(params.space)
        self._views = self._view.views(wide.reach_m, params.space.reach_m)
        self.space, self._wide_space = Space(params.space, robot), Space(wide, robot)
        self.footing = Footing(params.footing, params.space)
        tracked = params.slow_bodies, params.space.moving_objects, wide.moving_objects
        self._trackers, self._overhead_trackers = (Trackers(*(MovingObjects(one) for one in tracked)) for _ in range(2))
        self._people = People(params.people)
        self._overhead: Overhead | None = None
        if frames.OVERHEAD_LIDAR in robot.range_sensors:
            self._overhead = Overhead(robot, params, self.motion)
        self.chair, self._lean = False, UPRIGHT

    def forget(self) -> None:
        """Clears all stored observations."""
        self._last = None
        self._past_edges.clear()
        self.space.forget()
        self._wide_space.forget()
        self.footing.forget()
        for tracker in (*self._trackers, *self._overhead_trackers):
            tracker.forget()
        self._people.forget()
        if self._overhead is not None:
            self._overhead.forget()

    def overhead(self, points: Points, stamp_s: float) -> None:
        """A frame of the overhead LiDAR: adds its obstacles to the next scenes and its rays to the space model."""
        if self._overhead is not None:
            pose = self._pose_at(stamp_s)
            look = self._overhead.take(points, stamp_s, self.chair, self._lean)
            self._observe(self._overhead.near(look), look, pose, self._overhead_trackers)

    def scene(self, points: Points, stamp_s: float, obstructed: NDArray[np.bool_] | None = None) -> Scene:
        """Obstacles of the points and of the model of the space, which every sweep updates.

        obstructed: (DIRECTIONS,) of the ``Watch``: adds an obstacle close to the robot in these directions.
        """
        pose = self._pose_at(stamp_s)
        xyz, broken = self.points(points, stamp_s)
        seen = self.segment(xyz, self.motion.attitude_at(stamp_s))
        params = self._params.obstacles
        obstacles, specks = self._crowd.split(raised(seen.xyz, seen.labels))
        close = self._outlines[self.chair][np.zeros(DIRECTIONS, np.bool_) if obstructed is None else obstructed]
        if self.chair:
            # The chair hides most of an object beside it, so that few returns remain, see ``mixed``.
            self._chair_edges.look(points, self._lean)
            obstacles = np.concatenate([obstacles, specks[self._chair_edges.beside(specks)]])
            filter_params = self._params.mixed_pixels
            obstacles = self._chair_edges.without_sparse(obstacles, filter_params, filter_params.points_min)
        edges = self._edges(seen.profile)
        fresh = voxels(np.concatenate([obstacles, edges]), params.voxel_m, params.far_m, params.far_column_m)
        again = self._seen_again(edges, pose)
        hits = fresh
        if len(again) < len(edges):
            hits = voxels(np.concatenate([obstacles, again]), params.voxel_m, params.far_m, params.far_column_m)
        look = self._views.view(stamp_s, seen.sensor_m, seen.tilt, hits, seen.points, seen.profile)
        if self.chair:
            look = self._chair_edges.without(look)
        look = replace(look, specks=specks, looked_s=self._view.looked_s(points))
        self._observe(look, look, pose, self._trackers)
        known = self.space.remembered(pose, stamp_s - self._params.output.keep_s)
        shown = self._with_other_half(fresh, seen.profile, stamp_s)
        obstacles = np.concatenate([shown, self._from_above(stamp_s), known, close, self._falls(pose)])
        sensors = self._trackers, self._overhead_trackers
        moving = np.concatenate([one.at(stamp_s, pose) for by in sensors for one in (by.walking, by.fast)])
        return Scene(stamp_s, obstacles, self.space.frontier(pose), self.footing.ends(pose), moving, broken)

    def grid(self) -> SpaceGrid:
        """The present grid of the space, with drop-off edges as occupied."""
        known = self.space.grid()
        return replace(known, state=np.where(self.footing.drop, OCCUPIED, known.state))

    def people(self, stamp_s: float) -> tuple[Person, ...]:
        """People in the present grid, odom. stamp_s: of the last scene. Call it once for each published grid."""
        trackers = self._trackers.walking, self._overhead_trackers.walking
        bodies = [body for tracker in trackers for body in tracker.bodies(stamp_s)]
        return self._people.look(stamp_s, self.space.grid(), bodies)

    def _pose_at(self, stamp_s: float) -> Pose2:
        """base_link in odom; a restart of odometry or of the clock clears all stored observations, whose frame or
        stamps were others."""
        pose = self.motion.pose_at(stamp_s)
        if self.motion.restarts != self._restarts or self.space.has_jumped(pose, stamp_s):
            self._restarts = self.motion.restarts
            self.forget()
        return pose

    def _observe(self, look: View, wide_look: View, pose: Pose2, trackers: Trackers) -> None:
        """wide_look: for the grid of fast bodies. trackers: those of the same sensor. A lost fast body is not stored:
        it is predicted for ``coast_s``.
        """
        self.space.chair(self.chair)
        self.space.observe(look, pose)
        own = self._robot.footprint_with_chair if self.chair else self._robot.footprint
        self.footing.observe(look.floor, look.tilt, pose, own)
        self._lean = self._leans(pose) if self.chair else UPRIGHT
        space = self.space
        slow = space.appeared_while_standing(look, pose, self._params.slow_bodies)
        for body, vx_mps, vy_mps in trackers.slow.look(slow, look.stamp_s, space.is_visible_upright):
            space.mark_slow_hidden_body(body, vx_mps, vy_mps, pose)
        walking = space.appeared(look, pose)
        for body, vx_mps, vy_mps in trackers.walking.look(walking, look.stamp_s, space.is_visible):
            if not space.stands_in_view(body, vx_mps, vy_mps):
                space.mark_hidden_body(body, vx_mps, vy_mps, pose)
        walkers = self._trackers.walking, self._overhead_trackers.walking
        for place in space.vanished(pose):
            x, y, _ = place.tolist()
            if not any(tracker.follows(x, y, look.stamp_s) for tracker in walkers):
                space.mark_vanished(place[None], pose)
        wide = self._wide_space
        wide.chair(self.chair)
        wide.observe(wide_look, pose)
        appeared = wide.appeared(wide_look, pose)
        trackers.fast.look(appeared, look.stamp_s, wide.is_visible, partial(wide_look.seen_at_s, pose))

    def _leans(self, pose: Pose2) -> Float:
        """Of the chair, which turns about the latch's hooks: ahead where the ground falls beneath it, as at a crest."""
        robot = self._robot
        return np.array([self.footing.bends(pose, robot.footprint.front_m), robot.latch.height_m], np.float32)

    def points(self, points: Points, stamp_s: float) -> tuple[Float, int]:
        """Cropped and de-skewed: (n, 3) base_link at the stamp, and how many points were not finite."""
        return self._view.points(points, stamp_s, self.motion, self.chair, self._lean)

    def segment(self, xyz: Float, attitude: Attitude | None = None) -> Segmented:
        """Ground and other points of the spinning LiDAR, (n, 3), base_link."""
        return self._view.segment(xyz, attitude)

    def _from_above(self, stamp_s: float) -> Float:
        """(k, 3) recent obstacle points of the overhead LiDAR."""
        return _NOTHING if self._overhead is None else self._overhead.at(stamp_s)

    def _outline(self, chair: bool) -> Float:
        """(DIRECTIONS, 3) a point just outside the footprint in force, in each direction of the ``Watch``, m."""
        footprint = self._robot.footprint_with_chair if chair else self._robot.footprint
        gap, x0, y0 = self._params.watch.blind_gap_m, self._mount[0], self._mount[1]
        angles = (np.arange(DIRECTIONS) + 0.5) * (2.0 * np.pi / DIRECTIONS) - np.pi
        c, s = np.cos(angles), np.sin(angles)
        half = 0.5 * footprint.width_m + gap
        to_x = np.where(c > 0.0, footprint.front_m + gap - x0, x0 - footprint.rear_m + gap)
        to_y = np.where(s > 0.0, half - y0, half + y0)
        away = np.minimum(to_x / np.maximum(np.abs(c), 1e-9), to_y / np.maximum(np.abs(s), 1e-9))
        return np.stack([x0 + away * c, y0 + away * s, np.full_like(away, self._mount[2])], axis=1).astype(np.float32)

    def _edges(self, profile: ground.Profile) -> Float:
        """(k, 3) points on the edges of drop-offs, as high above the ground as the lowest obstacle."""
        found = np.flatnonzero(profile.drop_m > 0.0)
        angles = (found + 0.5) * (2.0 * np.pi / self._view.grid.sectors) - np.pi
        away, z = profile.drop_m[found], profile.drop_height_m[found] + self._params.ground.obstacle_min_m
        xyz = np.stack([self._mount[0] + away * np.cos(angles), self._mount[1] + away * np.sin(angles), z], axis=1)
        return xyz.astype(np.float32)

    def _seen_again(self, edges: Float, pose: Pose2) -> Float:
        """(k, 3) those of (n, 3) edges, base_link at ``pose``, that an earlier sweep has found beside them. Any edge is
        an obstacle at once; one of a single sweep may be noise, and is not stored."""
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        x, y = edges[:, 0], edges[:, 1]
        at = np.stack([pose.x + c * x - s * y, pose.y + s * x + c * y], axis=1)
        earlier = np.concatenate([np.empty((0, 2)), *self._past_edges])
        self._past_edges.append(at)
        step = at[:, None] - earlier[None]
        again: NDArray[np.bool_] = np.any(np.hypot(step[..., 0], step[..., 1]) <= _SAME_EDGE_M, axis=1)
        return edges[again]

    def _falls(self, pose: Pose2) -> Float:
        """(k, 3) points where the ground falls, as high above it as the lowest obstacle."""
        found = self.footing.edges(pose)
        found[:, 2] = self._params.ground.obstacle_min_m
        return found

    def _with_other_half(self, fresh: Float, profile: ground.Profile, stamp_s: float) -> Float:
        covered = profile.covered
        last, self._last = self._last, (stamp_s, fresh)
        if last is None or not 0.0 < stamp_s - last[0] <= self._params.output.keep_s:
            return fresh
        step = self.motion.pose_at(last[0]).relative_to(self.motion.pose_at(stamp_s))
        return np.concatenate([fresh, carried(last[1], step, self._view.xy_m, covered)])
