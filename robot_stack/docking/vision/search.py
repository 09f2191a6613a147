"""Finds and reads square markers in an image, or in a part of it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.docking.vision.params import SearchParams

Array = NDArray[np.float64]
Image = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Region:
    """Columns x0..x1 and rows y0..y1 (ends excluded) of an image, px."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def longer_px(self) -> int:
        return max(self.x1 - self.x0, self.y1 - self.y0)


def whole(image: Image) -> Region:
    """All of an image."""
    return Region(0, 0, image.shape[1], image.shape[0])


def around(points: Array, margin_share: float, margin_px: float, image: Image) -> Region | None:
    """The part of an image around (n, 2) points, with a margin; None if hardly anything of it lies in the image."""
    low, high = points.min(axis=0), points.max(axis=0)
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        return None
    margin = margin_share * float((high - low).max()) + margin_px
    height, width = image.shape
    x0, y0 = (int(value) for value in np.clip(low - margin, 0.0, [width, height]))
    x1, y1 = (int(value) for value in np.clip(high + margin + 1.0, 0.0, [width, height]))
    return Region(x0, y0, x1, y1) if min(x1 - x0, y1 - y0) > 16 else None


class MarkerSearch:
    """OpenCV's detector with one threshold window; corners are good to a pixel or two."""

    def __init__(self, dictionary: str, params: SearchParams) -> None:
        """Raises ValueError for a dictionary that OpenCV does not have."""
        number = getattr(cv2.aruco, dictionary, None)
        if number is None:
            raise ValueError(f"dictionary: OpenCV has no {dictionary}")
        self._params = params
        self._settings = _settings(params)
        self._detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(number), self._settings)

    def find(self, image: Image, region: Region, shrink: int, attempt: int) -> dict[int, Array]:
        """Corners (4, 2) in px of the whole image, by marker id, in OpenCV's order.

        shrink: the region is searched at 1 / shrink of its size. attempt: which threshold window to use, modulo their
        number. Of two markers with one id, the larger.
        """
        part = image[region.y0 : region.y1, region.x0 : region.x1]
        if shrink > 1:
            size = ((region.x1 - region.x0) // shrink, (region.y1 - region.y0) // shrink)
            shrunk = cv2.resize(part[: size[1] * shrink, : size[0] * shrink], size, interpolation=cv2.INTER_AREA)
            part = np.asarray(shrunk, dtype=np.uint8)
        self._set(attempt, region.longer_px)
        corners, ids, _ = self._detector.detectMarkers(part)
        numbers = np.ravel(np.asarray(ids if len(corners) else []))
        found: dict[int, Array] = {}
        for marker, quad in zip(numbers, corners, strict=True):
            place = (quad.reshape(4, 2).astype(np.float64) + 0.5) * shrink - 0.5 + (region.x0, region.y0)
            other = found.get(int(marker))
            if other is None or _area(place) > _area(other):
                found[int(marker)] = place
        return found

    def _set(self, attempt: int, longer_px: int) -> None:
        windows = self._params.threshold_windows_px
        window = windows[attempt % len(windows)]
        self._settings.adaptiveThreshWinSizeMin = self._settings.adaptiveThreshWinSizeMax = window
        # OpenCV takes the least perimeter as a share of the image's longer side.
        self._settings.minMarkerPerimeterRate = 4.0 * self._params.smallest_side_px / longer_px
        self._detector.setDetectorParameters(self._settings)


def _settings(params: SearchParams) -> cv2.aruco.DetectorParameters:
    settings = cv2.aruco.DetectorParameters()
    settings.adaptiveThreshConstant = params.threshold_constant
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
    settings.errorCorrectionRate = params.error_correction
    settings.maxErroneousBitsInBorderRate = params.border_error_share
    return settings


def _area(quad: Array) -> float:
    x, y = quad[:, 0], quad[:, 1]
    return float(0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))))
