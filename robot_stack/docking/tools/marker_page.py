"""The page of one marker, to scale: cells, quiet zone, crop marks, which way is up, a ruler."""

from __future__ import annotations

from itertools import groupby

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.docking.tools.page import Line, Page, Paper, Rect, Text

# Distances on the page, mm.
_HEADER_MM = 36.0  # above the quiet zone
_FOOTER_MM = 30.0  # below it
_CROP_GAP_MM = 1.0  # between the corner to cut and its mark
_CROP_LENGTH_MM = 3.0
_RULER_MM = 100.0


class DoesNotFit(ValueError):
    """The marker is larger than the paper. The message is one line for people."""


class NoSuchMarker(ValueError):
    """The dictionary or the id does not exist. The message is one line for people."""


def marker_bits(dictionary: str, marker_id: int) -> NDArray[np.bool_]:
    """(n, n) cells with the black border, True is black, first row at the top. Raises NoSuchMarker."""
    number = getattr(cv2.aruco, dictionary, None)
    if not dictionary.startswith("DICT_") or not isinstance(number, int):
        raise NoSuchMarker(f"dictionary: OpenCV has no {dictionary!r}")
    found = cv2.aruco.getPredefinedDictionary(number)
    count = len(found.bytesList)
    if not 0 <= marker_id < count:
        raise NoSuchMarker(f"marker {marker_id}: {dictionary} has ids 0 to {count - 1}")
    bits: NDArray[np.bool_] = np.asarray(cv2.aruco.generateImageMarker(found, marker_id, found.markerSize + 2)) == 0
    return bits


def marker_page(dictionary: str, marker_id: int, size_m: float, dock: str, paper: Paper) -> Page:
    """One marker in the middle of its page. Raises DoesNotFit, NoSuchMarker."""
    bits = marker_bits(dictionary, marker_id)
    size_mm = 1000.0 * size_m
    cell_mm = size_mm / len(bits)
    whole_mm = size_mm + 2.0 * cell_mm
    _check_fits(whole_mm, size_mm, paper)
    left = 0.5 * (paper.width_mm - whole_mm)
    bottom = _FOOTER_MM + 0.5 * (paper.height_mm - _HEADER_MM - _FOOTER_MM - whole_mm)
    title = f"marker {marker_id}, dock {dock}"
    return Page(
        paper,
        tuple(_cells(bits, left + cell_mm, bottom + cell_mm, cell_mm)),
        (*_crop_marks(left, bottom, whole_mm), *_up_arrow(left, bottom + whole_mm), *_ruler(paper)),
        (
            Text(left + 16.0, bottom + whole_mm + 22.0, title, 5.0),
            Text(left + 16.0, bottom + whole_mm + 13.0, f"this side up; {dictionary}, {size_mm:g} mm wide", 3.0),
            # Stays on the marker when it is cut out: at the rim of the quiet zone.
            Text(left + 3.0, bottom + 3.0, f"{title}, this is the lower edge", 1.8),
            Text(0.5 * paper.width_mm, 10.0, "100 mm: if it measures otherwise, print again at 100 %", 2.5, "center"),
        ),
    )


def _check_fits(whole_mm: float, size_mm: float, paper: Paper) -> None:
    room_mm = min(paper.width_mm - 2.0 * paper.margin_mm, paper.height_mm - _HEADER_MM - _FOOTER_MM)
    if whole_mm > room_mm:
        raise DoesNotFit(
            f"a marker of {size_mm:g} mm needs {whole_mm:g} mm with its quiet zone; "
            f"{paper.name} has room for {room_mm:g} mm"
        )


def _cells(bits: NDArray[np.bool_], left: float, bottom: float, cell: float) -> list[Rect]:
    """The black square and the white cells on it.

    White cells are drawn as runs along rows and along columns, which overlap: cell beside cell would show seams.
    """
    count = len(bits)
    black = Rect(left, bottom, count * cell, count * cell, True)
    white = ~bits
    across = [(row, first, 1, length) for row in range(count) for first, length in _runs(white[row])]
    down = [(first, column, length, 1) for column in range(count) for first, length in _runs(white[:, column])]
    return [
        black,
        *(
            Rect(left + column * cell, bottom + (count - row - rows) * cell, columns * cell, rows * cell, False)
            for row, column, rows, columns in sorted({*across, *down})
        ),
    ]


def _runs(values: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """(first index, length) of each stretch of True."""
    stretches = [
        list(group) for value, group in groupby(range(len(values)), lambda index: bool(values[index])) if value
    ]
    return [(stretch[0], len(stretch)) for stretch in stretches]


def _crop_marks(left: float, bottom: float, size: float) -> list[Line]:
    marks = []
    for x, outward_x in ((left, -1.0), (left + size, 1.0)):
        for y, outward_y in ((bottom, -1.0), (bottom + size, 1.0)):
            from_x, to_x = (x + outward_x * d for d in (_CROP_GAP_MM, _CROP_GAP_MM + _CROP_LENGTH_MM))
            from_y, to_y = (y + outward_y * d for d in (_CROP_GAP_MM, _CROP_GAP_MM + _CROP_LENGTH_MM))
            marks += [Line(from_x, y, to_x, y), Line(x, from_y, x, to_y)]
    return marks


def _up_arrow(left: float, top: float) -> list[Line]:
    return [Line(left + 8.0, top + 8.0, left + 8.0, top + 26.0, 0.5, arrow=True)]


def _ruler(paper: Paper) -> list[Line]:
    """100 mm with a tick at every 10 mm."""
    left, y = 0.5 * (paper.width_mm - _RULER_MM), 15.0
    ticks = [Line(left + at, y, left + at, y + (5.0 if at in (0, 50, 100) else 3.0)) for at in range(0, 101, 10)]
    return [Line(left, y, left + _RULER_MM, y), *ticks]
