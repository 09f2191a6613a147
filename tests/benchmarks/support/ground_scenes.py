"""Labelled sweeps for the benchmark of ground removal: places in the worlds, with the true ground labels."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import Pose2
from robot_stack.core.point_cloud import Points
from robot_stack.core.robot import Robot
from robot_stack.perception.deskew import Attitude
from sim.lidar import labels
from sim.lidar.views import sweep_at
from sim.worldfile import Ramp, WorldFile, load_world

F64 = NDArray[np.float64]
# Lower points of solids are not scored: with 2 cm of noise they are indistinguishable from ground.
FOOT_M = 0.03
_ON_SURFACE_M = 0.05


@dataclass(frozen=True, slots=True)
class Shot:
    """points: sensor frame. ground: (n,) truly drivable; scored: (n,) is scored. base: (4, 4) base_link in map."""

    name: str
    points: Points
    ground: NDArray[np.bool_]
    scored: NDArray[np.bool_]
    labels: NDArray[np.uint8]
    base: F64
    attitude: Attitude


def shots(robot: Robot, attitude_sigma_rad: float, seed: int) -> Iterator[Shot]:
    """One shot per place; the attitude has the inertial unit's error."""
    random = np.random.default_rng(seed)
    for number, (name, world_name, base, people) in enumerate(_places()):
        world = load_world(world_name)
        points, found = sweep_at(world, base, seed=seed + number, people=people)
        error = attitude_sigma_rad * random.standard_normal(2)
        yield _shot(name, world, points, found, base, robot, (float(error[0]), float(error[1])))


def _places() -> list[tuple[str, str, F64, list[Pose2]]]:
    people = [Pose2(4.0, 1.5, 0.0), Pose2(6.5, -0.5, 1.0), Pose2(11.0, 3.5, 2.0), Pose2(22.0, 12.0, 0.5)]
    level = [
        ("yard_start", "yard", (0.0, 0.0, 0.0)),
        ("yard_kerb", "yard", (10.0, 0.0, -0.6)),
        ("yard_bollards", "yard", (10.5, 5.0, 0.8)),
        ("yard_puddle", "yard", (18.0, -4.0, -0.7)),
        ("yard_far", "yard", (24.0, 12.5, 3.0)),
        ("ramps_start", "ramps", (0.0, 0.0, 0.0)),
        ("ramps_kerbs", "ramps", (1.0, -3.0, 0.0)),
        ("ramps_between", "ramps", (6.0, 2.2, 0.2)),
        ("ramps_before_10", "ramps", (1.9, 4.5, 0.1)),
    ]
    found = [(name, world, standing(x, y, yaw), people) for name, world, (x, y, yaw) in level]
    ramps = {ramp.name: ramp for ramp in load_world("ramps").ramps}
    for name, ramp, along in (
        ("ramps_5_up", "ramp_5", 1.5),
        ("ramps_10_foot", "ramp_10", 0.6),
        ("ramps_10_up", "ramp_10", 2.0),
        ("ramps_10_crest", "ramp_10", 4.0),
        ("ramps_10_top", "ramp_10", 5.0),
        ("ramps_10_down", "ramp_10", 8.0),
    ):
        found.append((name, "ramps", on_ramp(ramps[ramp], along), people))
    return found


def standing(x_m: float, y_m: float, yaw_rad: float, z_m: float = 0.0, pitch_rad: float = 0.0) -> F64:
    """(4, 4) base_link in map; pitch: nose down positive."""
    base = np.eye(4)
    base[:3, :3] = Attitude(0.0, pitch_rad).matrix()
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    base[:3, :3] = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ base[:3, :3]
    base[:3, 3] = x_m, y_m, z_m
    return base


def on_ramp(ramp: Ramp, along_m: float) -> F64:
    """base_link on the ramp's middle line, looking up it, ``along_m`` from its foot, all wheels on one slope."""
    place = Pose2(ramp.x_m, ramp.y_m, ramp.yaw_rad).compose(Pose2(along_m, 0.0, 0.0))
    far = ramp.total_length_m - along_m
    slope = -ramp.slope_rad if along_m < ramp.run_m else ramp.slope_rad if far < ramp.run_m else 0.0
    height = float(_ramp_height(ramp, np.array([along_m]))[0])
    return standing(place.x, place.y, place.yaw, height, slope)


def _shot(
    name: str,
    world: WorldFile,
    points: Points,
    found: NDArray[np.uint8],
    base: F64,
    robot: Robot,
    error_rad: tuple[float, float],
) -> Shot:
    xyz = np.stack([points["x"], points["y"], points["z"]], axis=1).astype(float) + robot.lidar_xyz_m
    in_map = xyz @ base[:3, :3].T + base[:3, 3]
    truly = found == labels.GROUND
    on_a_ramp = found == labels.RAMP
    truly |= on_a_ramp & _on_surface(world, in_map)
    solid = ~np.isin(found, (labels.GROUND, labels.RAMP, labels.PIT, labels.MIRROR))
    scored = ~(solid & (in_map[:, 2] < FOOT_M)) & ~(on_a_ramp & ~truly & (in_map[:, 2] < FOOT_M))
    roll = math.atan2(base[2, 1], base[2, 2])
    pitch = -math.asin(base[2, 0])
    return Shot(name, points, truly, scored, found, base, Attitude(roll + error_rad[0], pitch + error_rad[1]))


def _on_surface(world: WorldFile, xyz: F64) -> NDArray[np.bool_]:
    """(n,) on the upper face of a ramp, not on its side."""
    found = np.zeros(len(xyz), np.bool_)
    for ramp in world.ramps:
        c, s = math.cos(ramp.yaw_rad), math.sin(ramp.yaw_rad)
        dx, dy = xyz[:, 0] - ramp.x_m, xyz[:, 1] - ramp.y_m
        along, across = c * dx + s * dy, -s * dx + c * dy
        inside = (np.abs(across) <= 0.5 * ramp.width_m + _ON_SURFACE_M) & (along >= -_ON_SURFACE_M)
        inside &= along <= ramp.total_length_m + _ON_SURFACE_M
        found |= inside & (np.abs(xyz[:, 2] - _ramp_height(ramp, along)) <= _ON_SURFACE_M)
    return found


def _ramp_height(ramp: Ramp, along_m: F64) -> F64:
    slope = math.tan(ramp.slope_rad)
    height: F64 = np.minimum(ramp.height_m, slope * np.minimum(along_m, ramp.total_length_m - along_m))
    return np.maximum(height, 0.0)
