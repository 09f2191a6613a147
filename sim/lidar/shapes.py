"""Boxes and upright cylinders as arrays for the ray caster."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I16 = NDArray[np.int16]
I64 = NDArray[np.int64]

BOX, CYLINDER = 0, 1


@dataclass(frozen=True, slots=True)
class Shape:
    """One solid in the frame of its carrier: half sizes (box) or radius, radius, half height (cylinder), m.

    Turned by yaw about z, then by pitch about its new y. label: ``sim.lidar.labels``.
    """

    kind: int
    centre_m: tuple[float, float, float]
    half_m: tuple[float, float, float]
    label: int
    reflectivity: float
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class ShapeArrays:
    """(n,) shapes. mover: which mover carries it, -1: the map. rotation: (n, 3, 3) from shape to carrier."""

    kind: I64
    mover: I64
    centre_m: F64
    rotation: F64
    half_m: F64
    label: NDArray[np.uint8]
    reflectivity: NDArray[np.float32]


class Beams(NamedTuple):
    """Columns of beams. azimuths: (c,) evenly falling; elevations: (r,) evenly rising, rad. max_m: the longest range.

    origins (c, 3), rotations (c, 3, 3): the sensor in map for each column.
    """

    azimuths: F64
    elevations: F64
    origins: F64
    rotations: F64
    max_m: float


class Solids(NamedTuple):
    """``ShapeArrays`` and their movers: (b, m, 3) and (b, m, 3, 3), a pose per block of columns."""

    kind: I64
    mover: I64
    centre: F64
    turned: F64
    half: F64
    mover_position: F64
    mover_rotation: F64


class Met(NamedTuple):
    """(c, r) each: range in m (inf: nothing), what was met, cosine of the angle to its normal."""

    ranges: F32
    hits: I16
    cosines: F32


def pack(fixed: Iterable[Shape], carried: Sequence[Sequence[Shape]]) -> ShapeArrays:
    """Shapes of the map, then those of mover 0, mover 1 and so on."""
    items = [(-1, shape) for shape in fixed]
    items += [(index, shape) for index, shapes in enumerate(carried) for shape in shapes]
    return ShapeArrays(
        kind=np.array([shape.kind for _, shape in items], np.int64),
        mover=np.array([mover for mover, _ in items], np.int64),
        centre_m=np.array([shape.centre_m for _, shape in items], float).reshape(-1, 3),
        rotation=np.array([_rotation(shape) for _, shape in items], float).reshape(-1, 3, 3),
        half_m=np.array([shape.half_m for _, shape in items], float).reshape(-1, 3),
        label=np.array([shape.label for _, shape in items], np.uint8),
        reflectivity=np.array([shape.reflectivity for _, shape in items], np.float32),
    )


def _rotation(shape: Shape) -> F64:
    c, s = math.cos(shape.yaw_rad), math.sin(shape.yaw_rad)
    cp, sp = math.cos(shape.pitch_rad), math.sin(shape.pitch_rad)
    return np.array([[c * cp, -s, c * sp], [s * cp, c, s * sp], [-sp, 0.0, cp]])
