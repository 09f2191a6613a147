"""The ground of the kinematic benchmarks: level ground, ramps and edges, also visible to the LiDARs."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import Pose2
from robot_stack.perception.deskew import Attitude
from sim.lidar.params import LidarParams
from sim.lidar.scene import fixed_shapes, ground_rects
from sim.lidar.shapes import Shape
from sim.worldfile import Pit, Ramp, WorldFile
from tests.benchmarks.support.people_senses import NO_RECTS

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Terrain:
    """ramps, pits: define the ground's height. shapes, rects: the same for the ray caster.

    error_rad: of roll and pitch from the inertial unit.
    """

    ramps: tuple[Ramp, ...] = ()
    pits: tuple[Pit, ...] = ()
    shapes: tuple[Shape, ...] = ()
    rects: Floats = field(default_factory=lambda: NO_RECTS)
    error_rad: tuple[float, float] = (0.0, 0.0)

    def height_m(self, x: float, y: float) -> float:
        """Height of the ground at a position in map."""
        for ramp in self.ramps:
            along, across = _within(ramp.x_m, ramp.y_m, ramp.yaw_rad, x, y)
            if 0.0 <= along <= ramp.total_length_m and abs(across) <= 0.5 * ramp.width_m:
                slope = math.tan(ramp.slope_rad)
                return min(ramp.height_m, slope * min(along, ramp.total_length_m - along))
        return -max((pit.depth_m for pit in self.pits if inside(pit, x, y)), default=0.0)

    def standing(self, pose: Pose2, contacts: Floats) -> Floats:
        """(4, 4) in map of a body that stands on the ground with its wheels, (n, 2) in its own frame."""
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        if not self.ramps and not self.pits:
            return level(pose)
        heights = [self.height_m(pose.x + c * u - s * v, pose.y + s * u + c * v) for u, v in contacts]
        plane = np.column_stack([contacts, np.ones(len(contacts))])
        (along, across, z), *_ = np.linalg.lstsq(plane, np.array(heights), rcond=None)
        matrix = level(pose)
        matrix[:3, :3] = matrix[:3, :3] @ Attitude(math.atan(across), -math.atan(along)).matrix()
        matrix[2, 3] = z
        return matrix

    def attitude(self, base: Floats) -> Attitude:
        """The measured attitude of base_link (4, 4) in map."""
        roll, pitch = math.atan2(base[2, 1], base[2, 2]), -math.asin(base[2, 0])
        return Attitude(roll + self.error_rad[0], pitch + self.error_rad[1])


LEVEL_TERRAIN = Terrain()


def terrain_of(world: WorldFile, params: LidarParams, error_rad: tuple[float, float]) -> Terrain:
    """The ground of a world and the objects on it."""
    return Terrain(
        tuple(world.ramps),
        tuple(world.pits),
        tuple(fixed_shapes(world, params)),
        ground_rects(world, params),
        error_rad,
    )


def level(pose: Pose2) -> Floats:
    """(4, 4) of a body on level ground."""
    matrix = np.eye(4)
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    matrix[:2, :2] = [[c, -s], [s, c]]
    matrix[:2, 3] = pose.x, pose.y
    return matrix


def inside(pit: Pit, x: float, y: float) -> bool:
    along, across = _within(pit.x_m, pit.y_m, pit.yaw_rad, x, y)
    return abs(along) <= 0.5 * pit.length_m and abs(across) <= 0.5 * pit.width_m


def _within(x0: float, y0: float, yaw: float, x: float, y: float) -> tuple[float, float]:
    c, s = math.cos(yaw), math.sin(yaw)
    return c * (x - x0) + s * (y - y0), c * (y - y0) - s * (x - x0)
