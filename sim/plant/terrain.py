"""The solids of a world file: boxes, cylinders and the slabs of ramps, in the map frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from robot_stack.core.geometry import Pose2
from sim.worldfile import Box, Cylinder, Patch, Place, Ramp, WorldFile

Kind = Literal["kerb", "wall", "box", "cylinder", "ramp", "station", "patch"]

SLAB_THICKNESS_M = 0.20
# A slope slab begins this far below the ground, so that no gap opens at the foot.
SLAB_UNDERLAP_M = 0.20
PATCH_HALF_HEIGHT_M = 0.002
# A station: a board like the wheelchair's on a post. Half sizes and middle height, m.
BOARD_HALF_M = (0.02, 0.29, 0.22)
BOARD_MIDDLE_M = 0.45
POST_HALF_M = (0.02, 0.06, 0.115)


@dataclass(frozen=True, slots=True)
class Solid:
    """One geom: half sizes (box) or radius and half height (cylinder), m; turned by yaw about z, then pitch about y."""

    name: str
    kind: Kind
    shape: Literal["box", "cylinder"]
    centre_m: tuple[float, float, float]
    size_m: tuple[float, ...]
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0


def solids(world: WorldFile) -> list[Solid]:
    """Every solid of the world, ground excluded."""
    found: list[Solid] = []
    found += [_box(item, "kerb") for item in world.kerbs]
    found += [_box(item, "wall") for item in world.walls]
    found += [_box(item, "box") for item in world.boxes]
    found += [_cylinder(item) for item in world.cylinders]
    for ramp in world.ramps:
        found += _ramp(ramp)
    for name, place in world.stations.items():
        found += _station(name, place)
    found += [_patch(item) for item in world.patches]
    return found


def _box(item: Box, kind: Kind) -> Solid:
    half = (0.5 * item.length_m, 0.5 * item.width_m, 0.5 * item.height_m)
    return Solid(item.name, kind, "box", (item.x_m, item.y_m, half[2]), half, item.yaw_rad)


def _cylinder(item: Cylinder) -> Solid:
    half_height = 0.5 * item.height_m
    return Solid(item.name, "cylinder", "cylinder", (item.x_m, item.y_m, half_height), (item.radius_m, half_height))


def _patch(item: Patch) -> Solid:
    half = (0.5 * item.length_m, 0.5 * item.width_m, PATCH_HALF_HEIGHT_M)
    return Solid(item.name, "patch", "box", (item.x_m, item.y_m, 0.0), half, item.yaw_rad)


def _station(name: str, place: Place) -> list[Solid]:
    """The board's face is at the dock frame's x = 0, its thickness behind it."""
    pose = place.pose()
    behind = pose.compose(Pose2(BOARD_HALF_M[0], 0.0, 0.0))
    board = Solid(name, "station", "box", (behind.x, behind.y, BOARD_MIDDLE_M), BOARD_HALF_M, pose.yaw)
    foot = (behind.x, behind.y, POST_HALF_M[2])
    return [board, Solid(f"{name}_post", "station", "box", foot, POST_HALF_M, pose.yaw)]


def _ramp(ramp: Ramp) -> list[Solid]:
    run, top, total = ramp.run_m, ramp.top_length_m, ramp.total_length_m
    deck_half = (0.5 * top, 0.5 * ramp.width_m, 0.5 * ramp.height_m)
    deck = Solid(
        f"{ramp.name}_top", "ramp", "box", (*_along(ramp, run + 0.5 * top), deck_half[2]), deck_half, ramp.yaw_rad
    )
    return [_slope(ramp, "up", 0.0, ramp.yaw_rad), deck, _slope(ramp, "down", total, ramp.yaw_rad + math.pi)]


def _slope(ramp: Ramp, name: str, foot_m: float, yaw_rad: float) -> Solid:
    """A slab whose upper face rises from the ground at foot_m along the ramp, in the direction yaw_rad."""
    slope = ramp.slope_rad
    length = ramp.height_m / math.sin(slope) + SLAB_UNDERLAP_M
    # Middle of the slab, in (along the direction of climb, up) from the foot.
    on_face = 0.5 * length - SLAB_UNDERLAP_M
    along = on_face * math.cos(slope) + 0.5 * SLAB_THICKNESS_M * math.sin(slope)
    up = on_face * math.sin(slope) - 0.5 * SLAB_THICKNESS_M * math.cos(slope)
    direction = 1.0 if name == "up" else -1.0
    x, y = _along(ramp, foot_m + direction * along)
    half = (0.5 * length, 0.5 * ramp.width_m, 0.5 * SLAB_THICKNESS_M)
    return Solid(f"{ramp.name}_{name}", "ramp", "box", (x, y, up), half, yaw_rad, -slope)


def _along(ramp: Ramp, distance_m: float) -> tuple[float, float]:
    return ramp.x_m + distance_m * math.cos(ramp.yaw_rad), ramp.y_m + distance_m * math.sin(ramp.yaw_rad)
