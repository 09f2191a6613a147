"""Solids as convex faces, shaded by their normals."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.robot_shape import Placed

Floats = NDArray[np.float64]
_SIDES = 14  # of a cylinder, and around a sphere
_RINGS = 6
LIGHT = np.array([0.45, -0.35, 0.82])
"""Towards the light."""
_LIGHT_MIN = 0.62  # of faces turned away from the light


class Face(NamedTuple):
    """points: (n, 3) in map, m, convex. normal: (3,), outwards. colour: (3,) red, green, blue in [0, 1]."""

    points: Floats
    normal: Floats
    colour: Floats


def faces_of(solids: Sequence[Placed]) -> list[Face]:
    """Every face of the solids, whose poses are in map."""
    faces = []
    for _, solid, pose in solids:
        colour = np.array(solid.rgb())
        for points, normal in _unit(solid.kind):
            placed = (points * solid.size_m) @ pose[:3, :3].T + pose[:3, 3]
            turned = pose[:3, :3] @ (normal / solid.size_m)
            faces.append(Face(placed, turned / np.linalg.norm(turned), colour))
    return faces


def shaded(face: Face) -> Floats:
    """(3,) the face's colour in the light."""
    light = 0.5 + 0.5 * float(face.normal @ (LIGHT / np.linalg.norm(LIGHT)))
    return np.clip(face.colour * (_LIGHT_MIN + (1.0 - _LIGHT_MIN) * light), 0.0, 1.0)


def prism(outline: Floats, height_m: float, colour: Floats, piece_m: float) -> list[Face]:
    """Walls of a counter-clockwise outline (n, 2), in pieces no longer than ``piece_m``, for sorting by
    distance.
    """
    faces = []
    for begin, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        count = max(1, math.ceil(float(np.linalg.norm(end - begin)) / piece_m))
        stops = begin + np.linspace(0.0, 1.0, count + 1)[:, None] * (end - begin)
        ahead = (end - begin) / max(float(np.linalg.norm(end - begin)), 1e-9)
        normal = np.array([ahead[1], -ahead[0], 0.0])
        for a, b in itertools.pairwise(stops):
            faces.append(Face(np.array([[*a, 0.0], [*b, 0.0], [*b, height_m], [*a, height_m]]), normal, colour))
    return faces


@functools.cache
def _unit(kind: str) -> tuple[tuple[Floats, Floats], ...]:
    """Faces and normals of a solid of size 1."""
    match kind:
        case "box":
            return tuple(_box())
        case "cylinder":
            return tuple(_cylinder())
        case _:
            return tuple(_sphere())


def _box() -> list[tuple[Floats, Floats]]:
    faces = []
    for axis in range(3):
        for sign in (-0.5, 0.5):
            points = np.zeros((4, 3))
            points[:, axis] = sign
            points[:, (axis + 1) % 3] = -0.5, 0.5, 0.5, -0.5
            points[:, (axis + 2) % 3] = -0.5, -0.5, 0.5, 0.5
            faces.append((points, 2.0 * sign * np.eye(3)[axis]))
    return faces


def _ring(radius: float, z: float) -> Floats:
    angles = np.arange(_SIDES) * 2.0 * math.pi / _SIDES
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), np.full(_SIDES, z)], axis=1)


def _cylinder() -> list[tuple[Floats, Floats]]:
    low, high = _ring(0.5, -0.5), _ring(0.5, 0.5)
    faces = [(low, np.array([0.0, 0.0, -1.0])), (high, np.array([0.0, 0.0, 1.0]))]
    return faces + _belt(low, high)


def _sphere() -> list[tuple[Floats, Floats]]:
    angles = np.linspace(-0.5 * math.pi, 0.5 * math.pi, _RINGS + 1)
    rings = [_ring(0.5 * math.cos(angle), 0.5 * math.sin(angle)) for angle in angles]
    return [face for low, high in itertools.pairwise(rings) for face in _belt(low, high)]


def _belt(low: Floats, high: Floats) -> list[tuple[Floats, Floats]]:
    """Quadrilaterals between two rings around the same axis."""
    faces = []
    for i in range(_SIDES):
        j = (i + 1) % _SIDES
        points = np.array([low[i], low[j], high[j], high[i]])
        normal = np.cross(points[1] - points[3], points[2] - points[0])
        faces.append((points, normal / np.linalg.norm(normal)))
    return faces
