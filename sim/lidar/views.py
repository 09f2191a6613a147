"""One labelled sweep from anywhere: for tests, benches and pictures that need no running world."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2, exp_se2
from robot_stack.core.point_cloud import Points
from robot_stack.core.robot import Robot, load_robot
from sim.camera.motion import Track, still
from sim.lidar.params import LidarParams, load_lidar_params
from sim.lidar.scene import WHEELCHAIR, build_scene
from sim.lidar.sensor import Lidar
from sim.params import SimParams, load_sim_params
from sim.plant.people import PREFIX
from sim.worldfile import WorldFile

F64 = NDArray[np.float64]
_KNOTS = 11


def sweep_at(
    world: WorldFile,
    base: F64,
    *,
    twist: Twist2 = ZERO_TWIST,
    seed: int = 0,
    people: Iterable[Pose2] = (),
    chair: F64 | None = None,
    params: LidarParams | None = None,
) -> tuple[Points, NDArray[np.uint8]]:
    """``SWEEP`` points in the frame lidar and their labels (``sim.lidar.labels``), of one full turn at stamp 0.

    base: (4, 4) base_link in map at the stamp, so of the newest point; twist: its motion during the turn, base_link.
    people: places of persons, map. chair: (4, 4) of the wheelchair's dock frame in map; None: no wheelchair.
    """
    params = params or load_lidar_params()
    robot, sim = _machine()
    persons = {f"{PREFIX}{index}": still(_lifted(pose)) for index, pose in enumerate(people)}
    scene = build_scene(world, params, sim.wheelchair, people=persons)
    movers = dict(persons) if chair is None else {**persons, WHEELCHAIR: still(chair)}
    sweep = Lidar(scene, params, robot, seed).sweep(moving(base, twist, params.beams.period_s), 0.0, movers)
    return sweep.points, sweep.labels


def moving(base: F64, twist: Twist2, duration_s: float) -> Track:
    """A body that keeps ``twist`` in its own plane and is at ``base`` at time 0."""
    times = np.linspace(-duration_s, 0.0, _KNOTS)
    return Track(times, np.array([base @ _lifted(exp_se2(twist, float(time))) for time in times]))


def _lifted(pose: Pose2) -> F64:
    matrix = np.eye(4)
    c, s = np.cos(pose.yaw), np.sin(pose.yaw)
    matrix[:2, :2] = [[c, -s], [s, c]]
    matrix[:2, 3] = pose.x, pose.y
    return matrix


@cache
def _machine() -> tuple[Robot, SimParams]:
    return load_robot(), load_sim_params()
