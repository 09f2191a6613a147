"""The ride that a map is built from, recorded as the recorder does: ``python -m sim.mapping.ride FOLDER``.

Physics, drives, sensors and the kernels of drive and odometry in lockstep; people walk about. The driver looks
where he goes (he is told the true pose); what is recorded is only what the sensors say.
"""

from __future__ import annotations

import math
import sys
from collections import deque
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from rich.progress import Progress
from scipy.spatial.transform import Rotation

from robot_stack.core.config import Config, load
from robot_stack.core.geometry import Pose2, Twist2, wrap_angle
from robot_stack.drive.arbitration import Source
from robot_stack.drive.odometry import Encoders, Odometry
from sim.bench.kernel_stack import KernelStack
from sim.camera.motion import Track
from sim.lidar.params import load_lidar_params
from sim.lidar.scene import build_scene
from sim.lidar.sensor import Lidar
from sim.mapping.ride_writer import RideWriter
from sim.parameters import load_sim_params
from sim.plant.imu import ImuSample
from sim.plant.people import RADIUS_M
from sim.plant.world import Setup
from sim.worldfile import WorldFile, load_world

F64 = NDArray[np.float64]
Positive = Annotated[float, Field(gt=0.0)]

_KNOT_HZ = 100.0
_KNOTS = 40
_ROOM_M = 0.05
_PATIENCE_S, _ASIDE_MPS = 3.0, 0.3
_LIMIT_MPS = 0.35  # mean speed below which a ride is given up


class RideParams(Config):
    """``config/mapping_ride.yaml``."""

    world: str
    seed: Annotated[int, Field(ge=0)]
    speed_mps: Positive
    yaw_rate_radps: Positive
    look_ahead_m: Positive
    stand_s: Annotated[float, Field(ge=0.0)]
    sweep_rate_hz: Positive
    wait_ahead_m: Positive
    ways: Annotated[tuple[str, ...], Field(min_length=1)]

    def way(self, world: WorldFile) -> F64:
        """(n, 2) points in map, every 0.1 m."""
        corners = [corner for name in self.ways for corner in world.routes[name].points_m]
        points = np.array(corners, np.float64)
        keep = np.concatenate([[True], np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-6])
        points = points[keep]
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        dense = np.arange(0.0, along[-1], 0.1)
        return np.stack([np.interp(dense, along, points[:, axis]) for axis in (0, 1)], axis=1)


class Ride(KernelStack):
    """The stack's drive with a driver instead of navigation, and a tape that takes down what sensors say."""

    def __init__(self, params: RideParams, world: WorldFile, bag: RideWriter) -> None:
        self._bag = bag
        self._way, self._reached = params.way(world), 0
        self._ride, self._start_s, self._waiting_since_s = params, 0.0, 0.0
        self.true_poses: list[tuple[float, F64]] = []
        self._knots: deque[tuple[float, F64]] = deque(maxlen=_KNOTS)
        start = world.start.pose()
        self._people_knots: deque[tuple[float, dict[str, F64]]] = deque(maxlen=_KNOTS)
        super().__init__(Setup(world, seed=params.seed, start=start, people=True))
        self._start_s = self.time_s
        lidar_params, sim = load_lidar_params(), load_sim_params()
        names = [walker.name for walker in self.sim.world.people]
        scene = build_scene(world, lidar_params, sim.wheelchair, people=names)
        self._lidar = Lidar(scene, lidar_params, self.robot, params.seed)
        self.every(_KNOT_HZ, self._knot)
        self.every(params.sweep_rate_hz, self._sweep)

    @property
    def length_m(self) -> float:
        return 0.1 * len(self._way)

    @property
    def driven_m(self) -> float:
        return 0.1 * self._reached

    @property
    def done(self) -> bool:
        return self._reached >= len(self._way) - 2

    # --- driver ------------------------------------------------------------------------------------------------------

    def _navigation_tick(self) -> None:
        twist = self._requested() if self.time_s - self._start_s > self._ride.stand_s else Twist2(0.0, 0.0, 0.0)
        self._send(lambda: self.drive.on_command(Source.NAVIGATION, twist, self.time_s))

    def _requested(self) -> Twist2:
        if self.done:
            return Twist2(0.0, 0.0, 0.0)
        pose, _ = self.truth()
        here = np.array([pose.x, pose.y])
        ahead = self._way[self._reached : self._reached + 20]
        self._reached += int(np.argmin(np.linalg.norm(ahead - here, axis=1)))
        goal = self._way[min(self._reached + round(self._ride.look_ahead_m / 0.1), len(self._way) - 1)]
        to_goal = goal - here
        aside = self._aside(pose, to_goal)
        if aside is not None:
            return aside
        heading = wrap_angle(math.atan2(to_goal[1], to_goal[0]) - pose.yaw)
        remaining_m = 0.1 * (len(self._way) - self._reached)
        speed = self._ride.speed_mps * min(1.0, max(0.25, math.cos(heading)), 0.2 + remaining_m)
        omega = max(-self._ride.yaw_rate_radps, min(self._ride.yaw_rate_radps, 1.5 * heading))
        return Twist2(speed * math.cos(heading), speed * math.sin(heading), omega)

    def _aside(self, pose: Pose2, to_goal: F64) -> Twist2 | None:
        """What to do about a person on the strip of ground ahead: wait, then pass on the other side; None: nobody."""
        way = Pose2(pose.x, pose.y, math.atan2(to_goal[1], to_goal[0]))
        half_m = 0.5 * self.robot.footprint.width_m + RADIUS_M + _ROOM_M
        seen = [walker.pose().relative_to(way) for walker in self.sim.world.people]
        ahead = [one for one in seen if 0.0 < one.x < self._ride.wait_ahead_m and abs(one.y) < half_m]
        if not ahead:
            self._waiting_since_s = self.time_s
            return None
        if self.time_s - self._waiting_since_s < _PATIENCE_S:
            return Twist2(0.0, 0.0, 0.0)
        side = -math.copysign(_ASIDE_MPS, min(ahead, key=lambda one: one.x).y)
        turn = way.yaw - pose.yaw
        return Twist2(-side * math.sin(turn), side * math.cos(turn), 0.0)

    # --- sensors -----------------------------------------------------------------------------------------------------

    def _imu(self, sample: ImuSample) -> None:
        super()._imu(sample)
        self._bag.imu(sample)

    def _odometry(self, encoders: Encoders) -> None:
        self._bag.joint_states(encoders)
        super()._odometry(encoders)

    def on_odometry(self, stamp_s: float, odometry: Odometry) -> None:
        self._bag.odometry(stamp_s, odometry)

    def _knot(self) -> None:
        truth = self.sim.world.truth()
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_quat(truth.quaternion_xyzw).as_matrix()
        pose[:3, 3] = truth.position_m
        self._knots.append((self.time_s, pose))
        people = {walker.name: _matrix(walker.pose()) for walker in self.sim.world.people}
        self._people_knots.append((self.time_s, people))

    def _sweep(self) -> None:
        if len(self._knots) < _KNOTS:
            return
        stamp_s, pose = self._knots[-1]
        base = Track(np.array([time for time, _ in self._knots]), np.array([knot for _, knot in self._knots]))
        people = {
            name: Track(base.times_s, np.array([places[name] for _, places in self._people_knots]))
            for name in self._people_knots[-1][1]
        }
        sweep = self._lidar.sweep(base, stamp_s, people)
        self.true_poses.append((stamp_s, pose))
        self._bag.sweep(stamp_s, sweep.points)


def record(folder: Path, params: RideParams, truth_file: Path | None = None) -> None:
    """Drives and records. truth_file: .npz of the true poses, for judging a map, never for making one.

    Raises RuntimeError if the robot gets stuck.
    """
    world = load_world(params.world)
    with RideWriter(folder) as bag, Progress() as progress:
        ride = Ride(params, world, bag)
        task = progress.add_task("riding", total=ride.length_m)
        limit_s = ride.time_s + params.stand_s + ride.length_m / _LIMIT_MPS
        while not ride.done:
            if ride.time_s > limit_s:
                raise RuntimeError(f"the robot is stuck after {ride.driven_m:.1f} m, near {ride.truth()[0]}")
            ride.run(lambda: ride.done, 1.0)
            progress.update(task, completed=ride.driven_m)
        ride.run(lambda: False, params.stand_s)
    if truth_file is not None:
        stamps, poses = zip(*ride.true_poses, strict=True)
        np.savez_compressed(truth_file, stamp_s=np.array(stamps), pose=np.array(poses))


def _matrix(pose: Pose2) -> F64:
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("z", pose.yaw).as_matrix()
    matrix[0, 3], matrix[1, 3] = pose.x, pose.y
    return matrix


def main(arguments: list[str]) -> int:
    if len(arguments) not in (1, 2):
        print("usage: python -m sim.mapping.ride FOLDER [TRUTH.npz]", file=sys.stderr)
        return 2
    record(Path(arguments[0]), load(RideParams, "mapping_ride"), Path(arguments[1]) if len(arguments) == 2 else None)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
