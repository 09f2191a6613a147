"""Calibration of a camera from pictures of a ChArUco board."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from robot_stack.core.camera import Intrinsics
from robot_stack.core.config import Config, load

Grey = NDArray[np.uint8]
_TEXELS_PER_SQUARE = 120
_SMALLEST_SPREAD = 0.25  # of the picture's width and height: least extent of the corners of all pictures


class CalibrationError(Exception):
    """The pictures cannot calibrate a camera. The message gives the reason."""


class CharucoParams(Config):
    """``config/calibration.yaml``."""

    dictionary: Annotated[str, Field(pattern="^DICT_")]
    columns: Annotated[int, Field(ge=3, le=50)]
    rows: Annotated[int, Field(ge=3, le=50)]
    square_m: Annotated[float, Field(gt=0.0)]
    marker_m: Annotated[float, Field(gt=0.0)]
    min_corners: Annotated[int, Field(ge=6)]
    min_pictures: Annotated[int, Field(ge=4)]

    @model_validator(mode="after")
    def _marker_fits(self) -> CharucoParams:
        if self.marker_m >= self.square_m:
            raise ValueError("marker_m must be below square_m")
        return self

    def board(self) -> Any:
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, self.dictionary))
        return cv2.aruco.CharucoBoard((self.columns, self.rows), self.square_m, self.marker_m, dictionary)

    def image(self) -> Grey:
        """The board without margin, first row on top."""
        size = (self.columns * _TEXELS_PER_SQUARE, self.rows * _TEXELS_PER_SQUARE)
        return np.asarray(self.board().generateImage(size), dtype=np.uint8)


@dataclass(frozen=True, slots=True)
class Calibration:
    """The result from the pictures. errors_px: root mean square by picture. sigmas: standard deviations of fx, fy, cx,
    cy, k1, k2, p1, p2, k3."""

    intrinsics: Intrinsics
    error_px: float
    errors_px: dict[str, float]
    sigmas: tuple[float, ...]


def load_charuco() -> CharucoParams:
    """``config/calibration.yaml``. Raises ConfigError."""
    return load(CharucoParams, "calibration")


def calibrate(pictures: Mapping[str, Grey], params: CharucoParams) -> Calibration:
    """Intrinsics from pictures by name. Raises CalibrationError.

    k3 stays 0: a lens of this angle does not need it, and it correlates with k2.
    """
    size = _common_size(pictures)
    detector = cv2.aruco.CharucoDetector(params.board())
    places = np.asarray(params.board().getChessboardCorners(), np.float32)
    names, points, corners = [], [], []
    for name, picture in pictures.items():
        found, ids = detector.detectBoard(picture)[:2]
        if np.size(ids) >= params.min_corners:  # None counts as one
            names.append(name)
            points.append(places[np.ravel(ids)].reshape(-1, 1, 3))
            corners.append(np.asarray(found, np.float32).reshape(-1, 1, 2))
    _check_enough(len(names), len(pictures), params)
    _check_spread(np.concatenate(corners).reshape(-1, 2), size)
    error, k, d, _, _, sigmas, _, each = cv2.calibrateCameraExtended(
        points, corners, size, np.eye(3), np.zeros(5), flags=cv2.CALIB_FIX_K3
    )
    if not (np.isfinite(k).all() and np.isfinite(d).all()):
        raise CalibrationError("the calibration did not converge: the pictures are too similar")
    bends = [float(value) for value in np.ravel(d)[:5]]
    intrinsics = Intrinsics(
        size[0],
        size[1],
        float(k[0, 0]),
        float(k[1, 1]),
        float(k[0, 2]),
        float(k[1, 2]),
        (bends[0], bends[1], bends[2], bends[3], bends[4]),
    )
    errors = {name: float(value) for name, value in zip(names, np.ravel(each), strict=True)}
    return Calibration(intrinsics, float(error), errors, tuple(float(value) for value in np.ravel(sigmas)[:9]))


def _common_size(pictures: Mapping[str, Grey]) -> tuple[int, int]:
    """(width, height) of all pictures."""
    if not pictures:
        raise CalibrationError("no pictures")
    first, *others = pictures.items()
    for name, picture in others:
        if picture.shape != first[1].shape:
            size, wanted = ("x".join(map(str, p.shape[::-1])) for p in (picture, first[1]))
            raise CalibrationError(f"{name} is {size}, {first[0]} is {wanted}: all pictures must have one size")
    height, width = first[1].shape
    return width, height


def _check_enough(used: int, given: int, params: CharucoParams) -> None:
    board = f"the {params.columns} x {params.rows} board of {params.dictionary}"
    if used == 0:
        raise CalibrationError(f"no picture of {given} shows {board}")
    if used < params.min_pictures:
        raise CalibrationError(f"only {used} of {given} pictures show {board}; {params.min_pictures} are needed")


def _check_spread(corners: NDArray[np.float32], size: tuple[int, int]) -> None:
    reach = (corners.max(axis=0) - corners.min(axis=0)) / np.array(size)
    if reach.min() < _SMALLEST_SPREAD:
        raise CalibrationError("the board is at one position in all pictures: move it to the edges and corners too")


def write_board_pdf(path: Path, params: CharucoParams) -> None:
    """Writes the board to scale on one page. Raises OSError."""
    from robot_stack.docking.tools.page import Page

    rim = 12.0
    width, height = 1e3 * params.square_m * params.columns, 1e3 * params.square_m * params.rows
    page = Page(width + 2.0 * rim, height + 2.0 * rim)
    place = (rim, rim + width, rim, rim + height)
    page.axes.imshow(params.image(), extent=place, cmap="gray", interpolation="nearest", aspect="auto")
    page.axes.set(xlim=(0.0, width + 2.0 * rim), ylim=(0.0, height + 2.0 * rim))
    note = f"{params.dictionary}, squares {1e3 * params.square_m:g} mm, markers {1e3 * params.marker_m:g} mm"
    page.text(0.5 * width + rim, 0.4 * rim, f"{note}; print at 100 %, then measure: {width:g} mm across", 2.0, "center")
    page.figure.savefig(path, format="pdf")
