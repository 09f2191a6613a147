"""Marker images by ray casting, with exact areas and lens distortion, and no code shared with the detector."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.camera import Intrinsics
from robot_stack.core.docks import Dock, MarkerPlace

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

CAMERA = Intrinsics(1280, 720, 900.0, 900.0, 639.5, 359.5, (-0.052, 0.021, 0.0004, -0.0003, 0.0))
SIZE_M = 0.15
_BLACK, _WHITE, _GREY = 20.0, 220.0, 120.0
_FINE = 16


@cache
def _bits(marker: int) -> bytes:
    """The 6 x 6 cells of a marker, 1 = white."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    return bytes((cv2.aruco.generateImageMarker(dictionary, marker, 6) > 0).astype(np.uint8).ravel())


@numba.njit(cache=True)
def _colour(u: float, v: float, k: Any, h: Any, bits: Any, low: float, high: float, outside: float) -> float:
    """Grey level at a pixel position: the marker, its white margin of one cell, or ``outside``."""
    xd, yd = (u - k[2]) / k[0], (v - k[3]) / k[1]
    x, y = xd, yd
    for _ in range(8):
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k[4] + r2 * (k[5] + r2 * k[8]))
        dx = 2.0 * k[6] * x * y + k[7] * (r2 + 2.0 * x * x)
        dy = k[6] * (r2 + 2.0 * y * y) + 2.0 * k[7] * x * y
        x, y = (xd - dx) / radial, (yd - dy) / radial
    w = h[2, 0] * x + h[2, 1] * y + h[2, 2]
    a = (h[0, 0] * x + h[0, 1] * y + h[0, 2]) / w
    b = (h[1, 0] * x + h[1, 1] * y + h[1, 2]) / w
    # a, b: marker coordinates in cells from its centre, x right, y up
    column, row = math.floor(a + 3.0), math.floor(3.0 - b)
    if column < -1 or column > 6 or row < -1 or row > 6:
        return outside
    if column < 0 or column > 5 or row < 0 or row > 5:
        return high
    return high if bits[row * 6 + column] else low


@numba.njit(cache=True)
def _draw(image: Any, box: Any, k: Any, h: Any, bits: Any, low: float, high: float, fine: int) -> None:
    for v in range(box[1], box[3]):
        for u in range(box[0], box[2]):
            first = _colour(u - 0.5, v - 0.5, k, h, bits, low, high, image[v, u])
            same = (
                first == _colour(u + 0.5, v - 0.5, k, h, bits, low, high, image[v, u])
                and first == _colour(u - 0.5, v + 0.5, k, h, bits, low, high, image[v, u])
                and first == _colour(u + 0.5, v + 0.5, k, h, bits, low, high, image[v, u])
            )
            if same:
                image[v, u] = first
                continue
            total = 0.0
            for i in range(fine):
                for j in range(fine):
                    du, dv = (i + 0.5) / fine - 0.5, (j + 0.5) / fine - 0.5
                    total += _colour(u + du, v + dv, k, h, bits, low, high, image[v, u])
            image[v, u] = total / (fine * fine)


@dataclass(frozen=True, slots=True)
class Look:
    """Image quality: blur sigma in px, noise sigma in grey levels."""

    blur_px: float = 0.0
    noise: float = 0.0


CLEAN = Look()
USUAL = Look(blur_px=0.6, noise=3.0)


def background(intrinsics: Intrinsics = CAMERA) -> Array:
    return np.full((intrinsics.height, intrinsics.width), _GREY)


def draw(
    image: Array,
    marker: int,
    pose: Array,
    intrinsics: Intrinsics = CAMERA,
    size_m: float = SIZE_M,
    rows: tuple[int, int] | None = None,
) -> None:
    """Draws a marker at (4, 4) ``pose`` in the camera frame. If ``rows`` is given, only those rows are drawn."""
    cell = size_m / 6.0
    plane = pose[:3, [0, 1, 3]] @ np.diag([cell, cell, 1.0])
    k = np.array([intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy, *intrinsics.distortion])
    rim = 4.0 * cell * np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0]])
    pixels = project(rim, pose, intrinsics)
    low = np.floor(pixels.min(axis=0) - 2.0)
    high = np.ceil(pixels.max(axis=0) + 3.0)
    size = [intrinsics.width, intrinsics.height]
    box = np.r_[np.clip(low, 0, size), np.clip(high, 0, size)].astype(np.int64)
    if rows is not None:
        box[[1, 3]] = np.clip(box[[1, 3]], *rows)
    bits = np.frombuffer(_bits(marker), np.uint8)
    _draw(image, box, k, np.linalg.inv(plane), bits, _BLACK, _WHITE, _FINE)


def finish(image: Array, look: Look, random: np.random.Generator) -> Image:
    if look.blur_px > 0.0:
        image = cv2.GaussianBlur(image, (0, 0), look.blur_px)
    if look.noise > 0.0:
        image = image + random.normal(0.0, look.noise, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def picture(
    places: Mapping[int, MarkerPlace] | Dock,
    board: Array,
    look: Look = CLEAN,
    seed: int = 0,
    without: tuple[int, ...] = (),
    intrinsics: Intrinsics = CAMERA,
) -> Image:
    """Renders the markers of a dock whose frame is at (4, 4) ``board`` in the camera frame."""
    image = background(intrinsics)
    markers = places.markers if isinstance(places, Dock) else places
    for marker, place in markers.items():
        if marker not in without:
            draw(image, marker, board @ place.pose(), intrinsics)
    return finish(image, look, np.random.default_rng(seed))


def project(points: Array, pose: Array, intrinsics: Intrinsics = CAMERA) -> Array:
    """Projects (n, 3) points, given in a frame at ``pose``, to (n, 2) px with OpenCV."""
    turn, _ = cv2.Rodrigues(pose[:3, :3])
    pixels, _ = cv2.projectPoints(points, turn, pose[:3, 3], intrinsics.matrix(), intrinsics.coefficients())
    return np.asarray(pixels, dtype=np.float64).reshape(-1, 2)


def facing(
    distance_m: float, yaw_rad: float = 0.0, pitch_rad: float = 0.0, x_m: float = 0.0, y_m: float = 0.0
) -> Array:
    """Returns the (4, 4) dock frame in the camera frame: the board's centre (0.45 m up) at x_m, y_m, distance_m.

    yaw turns the board about its vertical, pitch about the horizontal axis of the image, both about its centre.
    """
    # Dock x (into the board) is the camera's z, dock y (left) is -x, dock z is -y.
    upright = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    turn, _ = cv2.Rodrigues(np.array([0.0, yaw_rad, 0.0]))
    tilt, _ = cv2.Rodrigues(np.array([pitch_rad, 0.0, 0.0]))
    pose = np.eye(4)
    pose[:3, :3] = tilt @ turn @ upright
    middle = np.array([x_m, y_m, distance_m])
    pose[:3, 3] = middle - pose[:3, :3] @ np.array([0.0, 0.0, 0.45])
    return pose
