"""The growing map from above: observed area, structure, path, robot."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from robot_stack.cli.errors import writing
from robot_stack.cli.map_picture import GREYS
from robot_stack.core.atomic_file import replace_file
from robot_stack.core.site_map import FREE, OCCUPIED, UNKNOWN, shaded
from robot_stack.mapping.poses import Floats, yaw_of
from robot_stack.mapping.teaching import GrowingMap

Image = npt.NDArray[np.uint8]

# Blue, green, red.
_BLACK = (25, 25, 25)
_WAY, _BEGIN, _ROBOT = (14, 127, 255), (44, 160, 44), (40, 39, 214)
_MARGIN_CELLS = 5
_ROBOT_M = 0.6


def taught_picture(growing: GrowingMap, resolution_m: float, longest_px: int) -> Image:
    """(height, width, 3) blue, green, red; x of map to the right, y upward. Small before the first sweep."""
    seen = growing.seen
    if not len(seen):
        return np.full((longest_px // 4, longest_px // 4, 3), GREYS[UNKNOWN], np.uint8)
    low = seen.min(axis=0) - _MARGIN_CELLS
    columns, rows = seen.max(axis=0) - low + 1 + _MARGIN_CELLS
    occupancy = np.full((rows, columns), UNKNOWN, np.int8)
    for found, value in ((seen, FREE), (growing.structure, OCCUPIED)):
        x, y = (found - low).T
        occupancy[y, x] = value
    cells = cv2.cvtColor(shaded(occupancy, GREYS), cv2.COLOR_GRAY2BGR)
    scale = longest_px / max(rows, columns)
    size = (max(1, round(columns * scale)), max(1, round(rows * scale)))
    # A wall one cell wide stays visible if cells are smaller than pixels.
    method = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_NEAREST
    picture: Image = np.asarray(cv2.resize(cells[::-1], size, interpolation=method), np.uint8)
    pixel_m = resolution_m / scale

    def pixels(points_m: Floats) -> npt.NDArray[np.int32]:
        along = points_m - low * resolution_m
        return np.round(np.column_stack((along[:, 0] / pixel_m, size[1] - along[:, 1] / pixel_m))).astype(np.int32)

    way = np.array([pose[:2, 3] for pose in growing.by_lidar])
    cv2.polylines(picture, [pixels(way)], False, _WAY, 2, cv2.LINE_AA)
    cv2.circle(picture, tuple(map(int, pixels(way[:1])[0])), 6, _BEGIN, -1, cv2.LINE_AA)
    cv2.fillPoly(picture, [pixels(_arrow(growing.by_lidar[-1]))], _ROBOT, cv2.LINE_AA)
    _scale_bar(picture, pixel_m)
    return picture


def write_picture(picture: Image, file: Path) -> None:
    """Replaces the file atomically. Raises CommandError."""
    whole, data = cv2.imencode(".png", picture)
    assert whole, "an image of three channels is a PNG"
    with writing(file):
        replace_file(file, data.tobytes())


def _arrow(pose: Floats) -> Floats:
    """(3, 2) m in map: an arrow at the robot's pose."""
    yaw = float(yaw_of(pose[None])[0])
    angles = np.array([yaw, yaw + 2.5, yaw - 2.5])
    return np.asarray(pose[:2, 3] + _ROBOT_M * np.column_stack((np.cos(angles), np.sin(angles))))


def _scale_bar(picture: Image, pixel_m: float) -> None:
    """A round length of at most a quarter of the width, in the lower left corner."""
    most_m = 0.25 * picture.shape[1] * pixel_m
    decade_m = 10.0 ** math.floor(math.log10(most_m))
    length_m = max(step * decade_m for step in (0.5, 1.0, 2.0, 5.0) if step * decade_m <= most_m)
    y = picture.shape[0] - 12
    cv2.line(picture, (12, y), (12 + round(length_m / pixel_m), y), _BLACK, 2)
    cv2.putText(picture, f"{length_m:g} m", (12, y - 8), cv2.FONT_HERSHEY_SIMPLEX, 0.6, _BLACK, 1, cv2.LINE_AA)
