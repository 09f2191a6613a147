"""Shared by the camera tests: cameras, poses, and edge detection that is independent of the rendering."""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.camera import Intrinsics, camera_file, load_intrinsics, mounting
from robot_stack.core.docks import Docks, load_docks, marker_corners
from robot_stack.core.robot import load_robot
from sim.camera.model import TrueCamera, draw_camera, load_camera_params
from sim.camera.params import CameraParams
from sim.camera.render import Renderer

Array = NDArray[np.float64]
FRAME = "front_camera"
DOCKS: Docks = load_docks()
PARAMS = load_camera_params()
NOMINAL = mounting(load_robot(), FRAME)
REACH_PX = 6  # search range to either side of the expected edge


def place(x_m: float, y_m: float, yaw_rad: float = 0.0, z_m: float = 0.0) -> Array:
    """Returns a (4, 4) planar pose."""
    pose = np.eye(4)
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    pose[:2, :2], pose[:3, 3] = [[c, -s], [s, c]], (x_m, y_m, z_m)
    return pose


@lru_cache
def calibrated() -> Intrinsics:
    return load_intrinsics(camera_file(FRAME))


def true_camera(seed: int = 3) -> TrueCamera:
    return draw_camera(FRAME, calibrated(), NOMINAL, PARAMS, np.random.default_rng(seed))


def sharp(**shutter: float) -> CameraParams:
    """No blur and no noise; only edges."""
    return PARAMS.model_copy(
        update={
            "lens": PARAMS.lens.model_copy(update={"blur_px": 0.0, "aperture_m": 0.0}),
            "sensor": PARAMS.sensor.model_copy(update={"read_noise_dn": 0.0, "full_well_e": 1e30}),
            "shutter": PARAMS.shutter.model_copy(update=shutter),
        }
    )


def renderer(camera: TrueCamera, params: CameraParams, seed: int = 0) -> Renderer:
    return Renderer(camera, DOCKS, params, np.random.default_rng(seed))


def project_on(camera: TrueCamera, points: Array, board: Array, base: Array) -> Array:
    """Projects (n, 3) points of the dock frame to (n, 2) pixels with OpenCV."""
    view = np.linalg.inv(base @ camera.mounting) @ board
    turn, _ = cv2.Rodrigues(view[:3, :3])
    k, d = camera.intrinsics.matrix(), camera.intrinsics.coefficients()
    pixels, _ = cv2.projectPoints(points.reshape(-1, 1, 3), turn, view[:3, 3], k, d)
    return np.asarray(pixels.reshape(-1, 2))


def marker_sides(marker: int, points: int = 200) -> list[Array]:
    """The four sides of a marker of chair_1 as points in the dock frame: top, right, bottom, left."""
    corners = np.c_[marker_corners(DOCKS.marker_size_m), np.ones(4)]
    corners = (DOCKS.docks["chair_1"].markers[marker].pose() @ corners.T).T[:, :3]
    part = np.linspace(0.08, 0.92, points)[:, None]  # away from the corners
    return [corners[i] + part * (corners[(i + 1) % 4] - corners[i]) for i in range(4)]


def edge_errors(picture: NDArray[np.uint8], sides: list[Array]) -> Array:
    """Returns the edge errors (px, along rows or columns) relative to expected curves of pixels (n, 2)."""
    found = []
    for index, curve in enumerate(sides):
        upright = index in (1, 3)
        image = picture.astype(float) if upright else picture.T.astype(float)
        along, across = (1, 0) if upright else (0, 1)
        order = np.argsort(curve[:, along])
        low, high = math.ceil(curve[:, along].min()), math.floor(curve[:, along].max())
        for line in range(max(low, 0), min(high + 1, image.shape[0])):
            wanted = float(np.interp(line, curve[order, along], curve[order, across]))
            middle = round(wanted)
            if REACH_PX <= middle < image.shape[1] - REACH_PX:
                found.append(edge_in_line(image[line], middle) - wanted)
    return np.array(found)


def edge_in_line(values: Array, middle: int) -> float:
    """Returns the position of an edge in a line of pixels: the position of a step with the same area."""
    part = values[middle - REACH_PX : middle + REACH_PX + 1]
    before, after = part[:2].mean(), part[-2:].mean()
    share = (part - after).sum() / (before - after)  # pixels on the first side
    return middle - REACH_PX - 0.5 + float(share)
