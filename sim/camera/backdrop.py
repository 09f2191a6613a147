"""Everything behind the boards: sky, ground and solids, ray-cast at a fraction of the resolution and enlarged.

A backdrop only: plausible light, edges, and squares that a detector has to reject.
"""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.camera import Intrinsics
from sim.camera.backdrop_kernel import cast_backdrop
from sim.camera.model import undistort
from sim.camera.params import CameraParams
from sim.camera.scenery import Scenery

Array = NDArray[np.float64]
F32 = NDArray[np.float32]
_TEXTURE_SIZE = 256
_TEXTURE_SEED = 20  # the same world for every camera
_NEAR_M = 0.05
# A view is drawn again once it has moved by so much: a quarter of a pixel at 900 px focal length, and 2 mm.
_TURN, _SHIFT_M = 2.5e-4, 2e-3


class Backdrop:
    """One camera's view of the scenery; drawn again only when the view changes."""

    def __init__(self, intrinsics: Intrinsics, params: CameraParams, scenery: Scenery) -> None:
        divisor = params.backdrop.divisor
        self._full = (intrinsics.height, intrinsics.width)
        self._small = (-(-intrinsics.height // divisor), -(-intrinsics.width // divisor))
        rows, columns = np.mgrid[0 : self._small[0], 0 : self._small[1]]
        middles = np.stack([(columns + 0.5) * divisor - 0.5, (rows + 0.5) * divisor - 0.5], axis=-1)
        self._rays = undistort(intrinsics, middles).astype(np.float32)
        self._scenery = scenery
        self._divisor = divisor
        a, e = params.backdrop.sun_azimuth_rad, params.backdrop.sun_elevation_rad
        self._sun = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        self._texture = _texture()
        self._grey = np.empty(self._small, np.float32)
        self._depth = np.empty(self._small, np.float32)
        self._seen: tuple[Array, ...] = ()
        self._enlarged = np.empty(self._full, np.float32)

    def draw(self, camera: Array, boards: Mapping[str, Array], out: F32) -> F32:
        """Fills ``out`` with reflectances; returns the depth of what was seen, (height, width) / divisor, m.

        camera: (4, 4) optical frame in map. boards: (4, 4) dock frames in map by dock id.
        """
        view = (camera, *(boards[name] for name in sorted(boards)))
        if not self._same(view):
            self._cast(camera, boards)
            self._seen = tuple(pose.copy() for pose in view)
        np.copyto(out, self._enlarged)
        return self._depth

    def _same(self, view: tuple[Array, ...]) -> bool:
        return len(view) == len(self._seen) and all(
            np.abs(new[:3, :3] - old[:3, :3]).max() < _TURN and np.abs(new[:3, 3] - old[:3, 3]).max() < _SHIFT_M
            for new, old in zip(view, self._seen, strict=True)
        )

    def _cast(self, camera: Array, boards: Mapping[str, Array]) -> None:
        parts = self._scenery.placed(boards)
        inverse = np.linalg.inv(parts.poses) if len(parts.poses) else parts.poses
        windows = self._windows(camera, parts.poses, parts.shapes)
        cast_backdrop(
            self._rays, camera, inverse, parts.shapes, windows, self._sun, self._texture, self._grey, self._depth
        )
        height, width = self._full
        large = (self._small[1] * self._divisor, self._small[0] * self._divisor)
        enlarged = cv2.resize(self._grey, large, interpolation=cv2.INTER_LINEAR)
        np.copyto(self._enlarged, enlarged[:height, :width])

    def _windows(self, camera: Array, poses: Array, shapes: Array) -> NDArray[np.int64]:
        """(n, 4) first and last + 1 row and column that each solid can touch, of the small picture."""
        if not len(poses):
            return np.zeros((0, 4), np.int64)
        rows, columns = self._small
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T
        corners = signs[None] * shapes[:, None, 1:4]
        points = np.einsum("nij,nkj->nki", poses[:, :3, :3], corners) + poses[:, None, :3, 3]
        local = (points - camera[:3, 3]) @ camera[:3, :3]  # (n, 8, 3) in the optical frame
        near = local[:, :, 2].min(axis=1) < _NEAR_M
        behind = local[:, :, 2].max(axis=1) < _NEAR_M
        flat = local[:, :, :2] / np.maximum(local[:, :, 2:], _NEAR_M)
        low, high = flat.min(axis=1), flat.max(axis=1)
        # The rays' coordinates rise almost evenly along rows and columns; a margin covers the distortion.
        x = self._rays[rows // 2, :, 0].astype(float)
        y = self._rays[:, columns // 2, 1].astype(float)
        margin_x, margin_y = 3 + columns // 40, 3 + rows // 40
        found = np.stack(
            [
                np.searchsorted(y, low[:, 1]) - margin_y,
                np.searchsorted(y, high[:, 1]) + margin_y,
                np.searchsorted(x, low[:, 0]) - margin_x,
                np.searchsorted(x, high[:, 0]) + margin_x,
            ],
            axis=1,
        )
        outside = (low[:, 0] > x[-1] * 1.2) | (high[:, 0] < x[0] * 1.2) | (low[:, 1] > y[-1] * 1.2)
        outside |= high[:, 1] < y[0] * 1.2
        found[near] = [0, rows, 0, columns]
        found[behind | (outside & ~near)] = 0
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


__all__ = ["Backdrop", "Scenery"]
