"""Sensors, perception and safety monitor of the benchmark ``people``: the kernels behind the simulated LiDARs."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from robot_stack.contract.frames import JOINTS, OVERHEAD_LIDAR
from robot_stack.core.config import load
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import IDENTITY, Pose2, Twist2, exp_se2
from robot_stack.core.point_cloud import Points
from robot_stack.core.robot import Robot
from robot_stack.core.robot_shape import load_robot_shape
from robot_stack.perception.deskew import Attitude
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline, Scene
from robot_stack.perception.watch import Watch, too_near
from robot_stack.safety.monitor import Memory, SafetyMonitor
from robot_stack.safety.params import SafetyParams
from sim.camera.history import BASE
from sim.camera.motion import Track
from sim.lidar import labels
from sim.lidar.bodies import chair_shapes, robot_shapes
from sim.lidar.kernels import FIRST_SOLID
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import WHEELCHAIR
from sim.lidar.scene import Scene as LidarScene
from sim.lidar.sensor import Lidar
from sim.lidar.shapes import Shape, pack
from sim.params import load_sim_params

# Rows that monitor the surroundings; the others are left out, because the rest of the robot counts as healthy.
ROWS = ("ESTOP_PRESSED", "OVERSPEED", "COLLISION_IMMINENT", "OBSTACLE_NEAR", "OBSTACLES_TIMEOUT")
SWEEP_S = 0.1
Floats = NDArray[np.float64]
NO_RECTS: Floats = np.empty((0, 7))
_DRIFT = 0.003  # relative drift limit of the odometry
_KEPT_S = 0.13


class Whereabouts:
    """Recent poses of everything that moves, for sensors whose sweep takes time."""

    def __init__(self) -> None:
        self._poses: dict[str, deque[tuple[float, Floats]]] = {}

    def add(self, name: str, now_s: float, pose: Floats) -> None:
        """pose: (4, 4) in map."""
        poses = self._poses.setdefault(name, deque())
        poses.append((now_s, pose))
        while poses[0][0] < now_s - _KEPT_S:
            poses.popleft()

    def tracks(self) -> dict[str, Track]:
        return {name: _track(poses) for name, poses in self._poses.items()}


def _track(poses: Iterable[tuple[float, Floats]]) -> Track:
    times_s, matrices = zip(*poses, strict=True)
    return Track(np.array(times_s), np.array(matrices))


class SimulatedSensors:
    """Both LiDARs with their configured noise, mixed returns and mountings.

    fixed: static shapes in map. movers: shapes of moving bodies, by the name of their poses; includes the wheelchair.
    rects: pits, see ``sim.lidar.scene.ground_rects``.
    """

    def __init__(
        self,
        robot: Robot,
        fixed: Iterable[Shape],
        movers: Mapping[str, Iterable[Shape]],
        seed: int,
        rects: Floats = NO_RECTS,
    ) -> None:
        chair = chair_shapes(load_sim_params().wheelchair, load_lidar_params().reflectivity.chair, passenger=True)
        named = {WHEELCHAIR: chair} | {name: list(shapes) for name, shapes in movers.items()}
        above = named | {BASE: robot_shapes(robot, load_robot_shape())}
        fixed = list(fixed)
        self._lidar = Lidar(_scene(fixed, named, rects), load_lidar_params(), robot, seed)
        params = load_lidar_params(OVERHEAD_LIDAR)
        self._overhead = Lidar(_scene(fixed, above, rects), params, robot, seed + 1, OVERHEAD_LIDAR)
        self._half = 0

    def half_sweep(self, now_s: float, tracks: Mapping[str, Track]) -> Points:
        """The half sweep that has just ended; the two halves alternate."""
        self._half = 1 - self._half
        return self._lidar.half_sweep(tracks[BASE], now_s, self._half, _others(tracks)).points

    def frame(self, now_s: float, tracks: Mapping[str, Track]) -> Points:
        """One frame of the overhead LiDAR."""
        return self._overhead.sweep(tracks[BASE], now_s, _others(tracks)).points


def _others(tracks: Mapping[str, Track]) -> dict[str, Track]:
    return {name: track for name, track in tracks.items() if name != BASE}


def _scene(fixed: list[Shape], movers: Mapping[str, list[Shape]], rects: Floats) -> LidarScene:
    shapes, shine = pack(fixed, list(movers.values())), load_lidar_params().reflectivity
    return LidarScene(
        shapes=shapes,
        movers=tuple(movers),
        rects=rects,
        label=np.concatenate([np.full(FIRST_SOLID, labels.GROUND, np.uint8), shapes.label]),
        reflectivity=np.concatenate([np.full(FIRST_SOLID, shine.ground, np.float32), shapes.reflectivity]),
    )


class Perception:
    """The kernels of perception_pipeline, with an odometry that drifts."""

    def __init__(self, robot: Robot, chair: bool, random: np.random.Generator) -> None:
        params = load(PerceptionParams, "perception_pipeline")
        self._pipeline, self._watch = Pipeline(robot, params), Watch(params.watch, robot.lidar_xyz_m[2])
        self._pipeline.chair = chair
        self._excused = too_near(robot, load_docks().latched_wheelchair(), params.watch) if chair else None
        self._scale = 1.0 + random.uniform(-_DRIFT, _DRIFT, 3)
        self._odom = IDENTITY

    def odometry(self, twist: Twist2, dt_s: float, now_s: float) -> None:
        sx, sy, sw = self._scale
        self._odom = self._odom.compose(exp_se2(Twist2(sx * twist.vx, sy * twist.vy, sw * twist.omega), dt_s))
        self._pipeline.motion.on_odometry(now_s, self._odom, twist)

    def attitude(self, attitude: Attitude, now_s: float) -> None:
        self._pipeline.motion.on_attitude(now_s, attitude)

    def overhead(self, points: Points, stamp_s: float) -> None:
        self._pipeline.overhead(points, stamp_s)

    def scene(self, points: Points, stamp_s: float) -> Scene | None:
        """None if the node would publish nothing."""
        if self._watch.blind(points, stamp_s, self._excused) or self._pipeline.motion.problem(stamp_s):
            return None
        return self._pipeline.scene(points, stamp_s, self._watch.obstructed)


def safety_params() -> SafetyParams:
    """The configured parameters with only the rows that monitor the surroundings."""
    return load(SafetyParams, "safety_monitor", {"rows": list(ROWS), "expected_processes": []})


def monitor(robot: Robot, params: SafetyParams, chair: bool, now_s: float) -> SafetyMonitor:
    return SafetyMonitor(params, robot, Memory(passenger=chair), now_s)


def joint_states(watching: SafetyMonitor, states: tuple[list[float], list[float]], now_s: float) -> None:
    watching.observation.joint_states(JOINTS, *states, now_s)


@cache
def chair_ahead() -> Pose2:
    """The frame of the latched wheelchair in base_link."""
    pose = load_docks().latched_wheelchair()
    assert pose is not None
    return pose


@cache
def castors() -> Floats:
    """(4, 2) ground contact points of the wheelchair, in its own frame, m."""
    chair = load_sim_params().wheelchair
    half = 0.5 * chair.castor_track_m
    return np.array([(x, y) for x in (chair.castor_front_x_m, chair.castor_rear_x_m) for y in (half, -half)])


def near(points: Floats, pose: Pose2, within_m: float) -> Floats:
    """(k, 3) in base_link at ``pose``: those of the points (n, 2) in map that lie within the distance."""
    found = points[np.hypot(points[:, 0] - pose.x, points[:, 1] - pose.y) <= within_m]
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    dx, dy = found[:, 0] - pose.x, found[:, 1] - pose.y
    return np.column_stack([c * dx + s * dy, -s * dx + c * dy, np.ones(len(found))])
