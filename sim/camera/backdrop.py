"""Everything behind the boards: sky, ground and solids, ray-cast at a fraction of the resolution and enlarged.

A backdrop only: plausible light, edges, and squares that a detector has to reject.
"""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.camera import Intrinsics
from robot_stack.core.config import ConfigError
from sim.camera.backdrop_kernel import cast_backdrop
from sim.camera.model import undistort
from sim.camera.params import CameraParams
from sim.camera.scenery import Scenery
from sim.camera.view import NEAR_M, flatten

Array = NDArray[np.float64]
F32 = NDArray[np.float32]
_TEXTURE_SIZE = 256
_TEXTURE_SEED = 20  # the same world for every camera
_BOX_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
_BOX_EDGES = np.array([[a, b] for a in range(8) for b in range(a + 1, 8) if bin(a ^ b).count("1") == 1])
# A view is redrawn after this motion: a quarter of a pixel at 900 px focal length, and 2 mm.
_TURN, _SHIFT_M = 2.5e-4, 2e-3


class Backdrop:
    """One camera's view of the scenery; drawn again only when the view changes."""

    def __init__(self, intrinsics: Intrinsics, params: CameraParams, scenery: Scenery) -> None:
        divisor = params.backdrop.divisor
        if intrinsics.height % divisor or intrinsics.width % divisor:
            raise ConfigError(f"sim_camera: backdrop.divisor ({divisor}) must divide the image's height and width")
        self._small = (intrinsics.height // divisor, intrinsics.width // divisor)
        rows, columns = np.mgrid[0 : self._small[0], 0 : self._small[1]]
        middles = np.stack([(columns + 0.5) * divisor - 0.5, (rows + 0.5) * divisor - 0.5], axis=-1)
        self._rays = undistort(intrinsics, middles).astype(np.float32)
        self._scenery = scenery
        a, e = params.backdrop.sun_azimuth_rad, params.backdrop.sun_elevation_rad
        self._sun = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        self._texture = _texture()
        self._grey = np.empty(self._small, np.float32)
        self._depth = np.empty(self._small, np.float32)
        self._seen: tuple[Array, ...] = ()

    def draw(self, camera: Array, boards: Mapping[str, Array], white: float, out: F32) -> F32:
        """Fills ``out`` with grey levels; returns the depth, (height, width) / divisor, m.

        camera: (4, 4) optical frame in map. boards: (4, 4) dock frames in map by dock id. white: of reflectance 1.
        """
        view = (camera, *(boards[name] for name in sorted(boards)))
        if not self._same(view):
            self._cast(camera, boards)
            self._seen = tuple(pose.copy() for pose in view)
        cv2.resize(self._grey * np.float32(white), out.shape[::-1], dst=out, interpolation=cv2.INTER_LINEAR)
        return self._depth

    def _same(self, view: tuple[Array, ...]) -> bool:
        return len(view) == len(self._seen) and all(
            np.abs(new[:3, :3] - old[:3, :3]).max() < _TURN and np.abs(new[:3, 3] - old[:3, 3]).max() < _SHIFT_M
            for new, old in zip(view, self._seen, strict=True)
        )

    def _cast(self, camera: Array, boards: Mapping[str, Array]) -> None:
        parts = self._scenery.placed(boards)
        inverse = np.asarray(np.linalg.inv(parts.poses) if len(parts.poses) else parts.poses, dtype=np.float64)
        windows = self._windows(camera, parts.poses, parts.shapes)
        cast_backdrop(
            self._rays, camera, inverse, parts.shapes, windows, self._sun, self._texture, self._grey, self._depth
        )

    def _windows(self, camera: Array, poses: Array, shapes: Array) -> NDArray[np.int64]:
        """(n, 4) first and last + 1 row and column that each solid can touch, of the small picture."""
        if not len(poses):
            return np.zeros((0, 4), np.int64)
        rows, columns = self._small
        corners = _BOX_CORNERS[None] * shapes[:, None, 1:4]
        points = np.einsum("nij,nkj->nki", poses[:, :3, :3], corners) + poses[:, None, :3, 3]
        local = (points - camera[:3, 3]) @ camera[:3, :3]  # (n, 8, 3) in the optical frame
        front = local[:, :, 2] > NEAR_M
        flat = local[:, :, :2] / np.maximum(local[:, :, 2:], NEAR_M)
        low, high = flat.min(axis=1), flat.max(axis=1)
        for index in np.flatnonzero(front.any(axis=1) & ~front.all(axis=1)):  # cut by the image plane
            cut = flatten(local[index], _BOX_EDGES)
            assert cut is not None
            low[index], high[index] = cut.min(axis=0), cut.max(axis=0)
        # The rays' coordinates rise almost evenly along rows and columns; a margin covers the distortion.
        x = self._rays[rows // 2, :, 0].astype(float)
        y = self._rays[:, columns // 2, 1].astype(float)
        margin_x, margin_y = 3 + columns // 60, 3 + rows // 60
        found = np.stack(
            [
                np.searchsorted(y, low[:, 1]) - margin_y,
                np.searchsorted(y, high[:, 1]) + margin_y,
                np.searchsorted(x, low[:, 0]) - margin_x,
                np.searchsorted(x, high[:, 0]) + margin_x,
            ],
            axis=1,
        )
        outside = (low[:, 0] > 1.2 * x[-1]) | (high[:, 0] < 1.2 * x[0])
        outside |= (low[:, 1] > 1.2 * y[-1]) | (high[:, 1] < 1.2 * y[0])
        found[outside | ~front.any(axis=1)] = 0
        return np.ascontiguousarray(np.clip(found, 0, [rows, rows, columns, columns]))


def _texture() -> NDArray[np.float32]:
    """(k, k) tileable noise of several scales, mean 0, about -1..1."""
    random = np.random.default_rng(_TEXTURE_SEED)
    total = np.zeros((_TEXTURE_SIZE, _TEXTURE_SIZE), np.float32)
    for sigma, weight in ((0.7, 0.5), (3.0, 0.6), (12.0, 0.5)):
        noise = random.standard_normal(total.shape).astype(np.float32)
        tiled = cv2.GaussianBlur(np.tile(noise, (3, 3)), (0, 0), sigma)
        smooth = tiled[_TEXTURE_SIZE : 2 * _TEXTURE_SIZE, _TEXTURE_SIZE : 2 * _TEXTURE_SIZE]
        total += weight * smooth / smooth.std()
    return np.ascontiguousarray(np.clip(0.5 * total, -1.0, 1.0), dtype=np.float32)
