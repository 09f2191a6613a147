"""One frame of a film: ground, shadows, lines and faces, far ones first."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.robot_shape import Placed
from robot_stack.film.camera import View
from robot_stack.film.faces import LIGHT, Face, faces_of, shaded
from robot_stack.film.site import Site

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

_SKY_RGB = (236, 239, 242)
_SHADOW = 0.86  # of the ground's brightness
_ROOF_RGB = np.array([0.76, 0.79, 0.83])
_UP = np.array([0.0, 0.0, 1.0])
_SHIFT = 4  # bits of a pixel's fraction


class Painter:
    """Draws at ``supersampling`` times the size and averages. Pictures are (height, width, 3) red, green, blue."""

    def __init__(self, site: Site, width_px: int, height_px: int, supersampling: int) -> None:
        self._site = site
        self._size = (width_px, height_px)
        self._large = (width_px * supersampling, height_px * supersampling)
        self._scale = supersampling
        self._roofs = [Face(np.c_[points, np.full(len(points), z)], _UP, _ROOF_RGB) for points, z in site.roofs]

    @property
    def size_px(self) -> tuple[int, int]:
        """Of the picture that is drawn and then averaged."""
        return self._large

    def paint(
        self, view: View, solids: Sequence[Placed], lines: Sequence[tuple[Floats, tuple[int, int, int], float]]
    ) -> Image:
        """lines: (n, 2) points on the ground, m; colour; width in pixels of the finished picture."""
        flat = view.ground() @ self._site.to_map
        image = np.empty((self._large[1], self._large[0], 3), np.uint8)
        image[:] = _SKY_RGB
        # Pixels outside the map are unchanged.
        cv2.warpPerspective(self._site.ground, flat, self._large, image, borderMode=cv2.BORDER_TRANSPARENT)
        faces = faces_of(solids)
        self._shadows(image, view, faces)
        for points, colour, width in lines:
            self._line(image, view, points, colour, width)
        self._faces(image, view, [*self._site.faces, *self._roofs, *faces])
        return np.asarray(cv2.resize(image, self._size, interpolation=cv2.INTER_AREA), np.uint8)

    def _shadows(self, image: Image, view: View, faces: Sequence[Face]) -> None:
        mask = np.zeros(image.shape[:2], np.uint8)
        for face in faces:
            if face.normal[2] > 0.2:
                low = face.points.copy()
                low[:, :2] -= np.outer(face.points[:, 2], LIGHT[:2] / LIGHT[2])
                low[:, 2] = 0.0
                cv2.fillConvexPoly(mask, _fixed(view.pixels(low)), 255, shift=_SHIFT)
        shaded_ground = image[mask > 0] * _SHADOW
        image[mask > 0] = shaded_ground.astype(np.uint8)

    def _line(self, image: Image, view: View, points: Floats, colour: tuple[int, int, int], width: float) -> None:
        if len(points) < 2:
            return
        raised = np.c_[points, np.zeros(len(points))]
        near = view.depth_m(raised) > 1.0
        pixels = _fixed(view.pixels(raised[near]))
        cv2.polylines(image, [pixels], False, colour, max(1, round(width * self._scale)), cv2.LINE_AA, _SHIFT)

    def _faces(self, image: Image, view: View, faces: Sequence[Face]) -> None:
        """Draws far faces first and omits those that face away."""
        towards = [face for face in faces if float(face.normal @ (view.eye - face.points[0])) > 0.0]
        if not towards:
            return
        depths = view.depth_m(np.array([face.points.mean(axis=0) for face in towards]))
        for index in np.argsort(-depths):
            face = towards[index]
            if depths[index] <= 1.0:
                continue
            colour = tuple(int(value) for value in np.round(255.0 * shaded(face)))
            cv2.fillPoly(image, [_fixed(view.pixels(face.points))], colour, cv2.LINE_AA, _SHIFT)


def _fixed(pixels: Floats) -> NDArray[np.int32]:
    """Fixed-point pixels for OpenCV, clipped far outside the picture."""
    fixed: NDArray[np.int32] = np.round(np.clip(pixels, -1e4, 1e4) * 2**_SHIFT).astype(np.int32)
    return fixed
