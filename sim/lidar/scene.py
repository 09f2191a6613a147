"""Everything visible to the LiDAR, as arrays: the world's solids, wet ground, pits, and movers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.camera.history import BASE
from sim.lidar import labels
from sim.lidar.bodies import chair_shapes, person_shapes
from sim.lidar.kernels import FIRST_SOLID
from sim.lidar.params import LidarParams
from sim.lidar.shapes import BOX, CYLINDER, F64, Shape, ShapeArrays, pack
from sim.params import Wheelchair
from sim.plant.doors import PREFIX
from sim.plant.terrain import Solid, solids
from sim.worldfile import Door, Patch, Pit, WorldFile

WHEELCHAIR = "wheelchair"


@dataclass(frozen=True, slots=True)
class Scene:
    """movers: names of the bodies that carry shapes, as in /sim/bodies. rects: see ``kernels.cast_ground``.

    label, reflectivity: by number of what a beam met. glass: numbers of the shapes that are panes.
    """

    shapes: ShapeArrays
    movers: tuple[str, ...]
    rects: F64
    label: NDArray[np.uint8]
    reflectivity: NDArray[np.float32]
    glass: tuple[int, ...] = ()


def build_scene(
    world: WorldFile,
    params: LidarParams,
    chair: Wheelchair,
    *,
    people: Iterable[str] = (),
    passenger: bool = True,
    own: Sequence[Shape] = (),
) -> Scene:
    """people: names of the bodies that are persons. passenger: the wheelchair is occupied.

    own: the visible parts of the robot itself, in base_link.
    """
    shine = params.reflectivity
    standing = _standing(world)
    fixed = fixed_shapes(world, params)
    names = tuple(people)
    carried = [chair_shapes(chair, shine.chair, passenger=passenger), *(person_shapes(shine.person) for _ in names)]
    doors = tuple(f"{PREFIX}{door.name}" for door in world.doors)
    carried += [[_panel(door, shine.box)] for door in world.doors]
    carried += [list(own)] if own else []
    shapes = pack(fixed, carried)
    ground = [labels.GROUND, labels.GROUND, labels.PIT, labels.MIRROR, labels.AIRBORNE]
    light = [shine.ground, params.wet.reflectivity, shine.ground, params.wet.mirror_reflectivity, 1.0]
    assert len(ground) == FIRST_SOLID
    return Scene(
        shapes=shapes,
        movers=(WHEELCHAIR, *names, *doors, *([BASE] if own else [])),
        rects=ground_rects(world, params),
        label=np.concatenate([np.array(ground, np.uint8), shapes.label]),
        reflectivity=np.concatenate([np.array(light, np.float32), shapes.reflectivity]),
        glass=tuple(index for index, solid in enumerate(standing) if solid.name in world.glass),
    )


def fixed_shapes(world: WorldFile, params: LidarParams) -> list[Shape]:
    """The static shapes of the world, in map."""
    surfaces = {**dict.fromkeys(world.glass, params.glass.dirt), **world.surfaces}
    return [_shape(solid, params, surfaces) for solid in _standing(world)]


def _standing(world: WorldFile) -> list[Solid]:
    return [solid for solid in solids(world) if solid.kind != "patch"]


def _shape(solid: Solid, params: LidarParams, surfaces: Mapping[str, float]) -> Shape:
    light = surfaces.get(solid.name, float(getattr(params.reflectivity, solid.kind)))
    if solid.shape == "cylinder":
        radius, half_height = solid.size_m
        return Shape(CYLINDER, solid.centre_m, (radius, radius, half_height), labels.OF_KIND[solid.kind], light)
    x, y, z = solid.size_m
    kind, label = BOX, labels.OF_KIND[solid.kind]
    return Shape(kind, solid.centre_m, (x, y, z), label, light, solid.yaw_rad, solid.pitch_rad)


def _panel(door: Door, reflectivity: float) -> Shape:
    half_m = 0.5 * door.height_m
    return Shape(BOX, (0.0, 0.0, half_m), (0.5 * door.length_m, 0.5 * door.width_m, half_m), labels.BOX, reflectivity)


def ground_rects(world: WorldFile, params: LidarParams) -> F64:
    """(k, 7) wet ground and pits, see ``kernels.cast_ground``."""
    wet = [patch for patch in world.patches if patch.friction < params.wet.friction_below]
    rows = [(*_placed(item), 0.0) for item in wet] + [(*_placed(pit), pit.depth_m) for pit in world.pits]
    return np.array(rows, float).reshape(-1, 7)


def _placed(item: Patch | Pit) -> tuple[float, ...]:
    c, s = math.cos(item.yaw_rad), math.sin(item.yaw_rad)
    return item.x_m, item.y_m, c, s, 0.5 * item.length_m, 0.5 * item.width_m
