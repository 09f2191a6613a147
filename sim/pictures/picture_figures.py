"""Figures for pictures only: the markers on the boards, and a passenger in the wheelchair."""

from __future__ import annotations

from typing import Any

import cv2
import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_stack.core.docks import load_docks
from sim.plant.wheelchair import matrix_of
from sim.plant.world import WHEELCHAIR, World

_CELLS = 6  # of a marker of DICT_4X4: four and a black rim
_PAPER_M, _INK_M = 0.001, 0.002  # thickness, so that ink lies above paper above the board
_WHITE, _BLACK = (1.0, 1.0, 1.0, 1.0), (0.05, 0.05, 0.05, 1.0)
_SHIRT, _TROUSERS, _SKIN = (0.62, 0.22, 0.20, 1.0), (0.20, 0.22, 0.28, 1.0), (0.86, 0.68, 0.56, 1.0)
_MARGIN = 1.25  # of the paper around a marker
Matrix = NDArray[np.float64]
Point = tuple[float, float, float]
Rgba = tuple[float, float, float, float]


def paint_boards(scene: Any, world: World) -> None:
    """Paints the markers of every board in this world."""
    docks = load_docks()
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, docks.dictionary))
    half = 0.5 * docks.marker_size_m
    for frame, pose in world.bodies():
        kind, board = ("wheelchair" if frame == WHEELCHAIR else "station"), matrix_of(pose)
        for dock_id, dock in docks.docks.items():
            if dock.kind != kind or (kind == "station" and dock_id != frame):
                continue
            for marker, place in dock.markers.items():
                at = board @ place.pose()
                _box(scene, at, (0.0, 0.0, 0.0), (_MARGIN * half, _MARGIN * half, _PAPER_M), _WHITE)
                _cells(scene, at, half, np.asarray(cv2.aruco.generateImageMarker(dictionary, marker, _CELLS), np.uint8))


def _cells(scene: Any, at: Matrix, half_m: float, bits: NDArray[np.uint8]) -> None:
    cell = 2.0 * half_m / _CELLS
    for row, column in zip(*np.nonzero(bits == 0), strict=True):
        centre = (-half_m + (column + 0.5) * cell, half_m - (row + 0.5) * cell, 0.0)
        _box(scene, at, centre, (0.5 * cell, 0.5 * cell, _INK_M), _BLACK)


def paint_passenger(scene: Any, world: World) -> None:
    """A figure on the seat of a chair that is heavier than an empty one."""
    if world.chair is None or not world.chair.in_sight:
        return
    if world.model.body("wheelchair").mass[0] <= world.robot.chair_mass_kg:
        return
    at, seat = world.chair.matrix(), world.params.wheelchair.seat_top_m
    _limb(scene, at, (0.17, 0.0, seat + 0.15), (0.16, 0.0, seat + 0.45), 0.14, _SHIRT)
    _limb(scene, at, (0.165, 0.0, seat + 0.5), (0.17, 0.0, seat + 0.7), 0.05, _SKIN)
    _limb(scene, at, (0.17, 0.0, seat + 0.72), (0.17, 0.0, seat + 0.75), 0.10, _SKIN)
    for side in (0.11, -0.11):
        _limb(scene, at, (0.17, side, seat + 0.08), (0.46, side, seat + 0.07), 0.07, _TROUSERS)
        _limb(scene, at, (0.46, side, seat + 0.07), (0.50, side, 0.12), 0.055, _TROUSERS)
        arm = 1.9 * side
        _limb(scene, at, (0.15, arm, seat + 0.46), (0.20, arm, seat + 0.18), 0.045, _SHIRT)
        _limb(scene, at, (0.20, arm, seat + 0.18), (0.42, arm, seat + 0.18), 0.04, _SKIN)


def _box(scene: Any, at: Matrix, centre: Point, half: Point, color: Rgba) -> None:
    _add(scene, mujoco.mjtGeom.mjGEOM_BOX, np.array(half), at[:3, :3] @ centre + at[:3, 3], at[:3, :3], color)


def _limb(scene: Any, at: Matrix, start: Point, end: Point, radius_m: float, color: Rgba) -> None:
    add_capsule(scene, at[:3, :3] @ start + at[:3, 3], at[:3, :3] @ end + at[:3, 3], radius_m, color)


def add_capsule(scene: Any, start: ArrayLike, end: ArrayLike, radius_m: float, color: Rgba) -> None:
    """A round line between two points, m, in the world. A full scene stays as it is."""
    geom = _add(scene, mujoco.mjtGeom.mjGEOM_CAPSULE, np.zeros(3), np.zeros(3), np.eye(3), color)
    if geom is not None:
        mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_CAPSULE, radius_m, np.array(start), np.array(end))


def _add(scene: Any, kind: int, size: Matrix, place: Matrix, turn: Matrix, color: Rgba) -> Any:
    """The new geom; None if the scene is full."""
    if scene.ngeom >= scene.maxgeom:
        return None
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(geom, kind, size, place, turn.flatten(), np.array(color, np.float32))
    scene.ngeom += 1
    return geom
