"""The ride for building a map, in the recorder's format: ``python -m sim.mapping.ride FOLDER``.

People walk about.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from rich.progress import Progress

from robot_stack.core.config import Config, Positive, load
from robot_stack.core.geometry import Pose2, Twist2, wrap_angle
from sim.mapping.recorded_drive import RecordedDrive
from sim.mapping.ride_writer import RideWriter
from sim.plant.people import RADIUS_M
from sim.plant.world import Setup
from sim.worldfile import WorldFile, load_world

F64 = NDArray[np.float64]

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


class Ride(RecordedDrive):
    """A driver that replaces navigation and follows the ways."""

    def __init__(self, params: RideParams, world: WorldFile, bag: RideWriter) -> None:
        self._way, self._reached = params.way(world), 0
        self._ride, self._start_s, self._waiting_since_s = params, 0.0, 0.0
        setup = Setup(world, seed=params.seed, start=world.start.pose(), people=True)
        super().__init__(setup, bag, params.sweep_rate_hz, [person.name for person in world.people])
        self._start_s = self.time_s

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

    def requested(self) -> Twist2:
        if self.done or self.time_s - self._start_s <= self._ride.stand_s:
            return Twist2(0.0, 0.0, 0.0)
        pose = self.truth()
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
        """The reaction to a person on the strip of ground ahead: wait, then pass on the other side; None: no person."""
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


def record(folder: Path, params: RideParams, truth_file: Path | None = None) -> None:
    """Drives and records. truth_file: .npz of the true poses, only for evaluating a map.

    Raises RuntimeError if the robot gets stuck.
    """
    world = load_world(params.world)
    with RideWriter(folder) as bag, Progress() as progress:
        ride = Ride(params, world, bag)
        task = progress.add_task("riding", total=ride.length_m)
        limit_s = ride.time_s + params.stand_s + ride.length_m / _LIMIT_MPS
        while not ride.done:
            if ride.time_s > limit_s:
                raise RuntimeError(f"the robot is stuck after {ride.driven_m:.1f} m, near {ride.truth()}")
            ride.run(1.0)
            progress.update(task, completed=ride.driven_m)
        ride.run(params.stand_s)
    if truth_file is not None:
        stamps, poses = zip(*ride.true_poses, strict=True)
        np.savez_compressed(truth_file, stamp_s=np.array(stamps), pose=np.array(poses))


def main(arguments: list[str]) -> int:
    if len(arguments) not in (1, 2):
        print("usage: python -m sim.mapping.ride FOLDER [TRUTH.npz]", file=sys.stderr)
        return 2
    record(Path(arguments[0]), load(RideParams, "mapping_ride"), Path(arguments[1]) if len(arguments) == 2 else None)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
