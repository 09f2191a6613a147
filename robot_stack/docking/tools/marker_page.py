"""The page of one marker, to scale: cells, quiet zone, crop marks, which way is up, a ruler."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.docking.tools.page import Page, Paper

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
    top, title = bottom + whole_mm, f"marker {marker_id}, dock {dock}"
    page = Page(paper.width_mm, paper.height_mm)
    corners = ((left + (column + 1) * cell_mm, top - (row + 2) * cell_mm) for row, column in np.argwhere(bits))
    page.blacken((x, y, cell_mm, cell_mm) for x, y in corners)
    _mark_corners(page, left, bottom, whole_mm)
    page.arrow_up(left + 8.0, top + 8.0, top + 26.0, 0.5)
    page.text(left + 16.0, top + 22.0, title, 5.0)
    page.text(left + 16.0, top + 13.0, f"this side up; {dictionary}, {size_mm:g} mm wide", 3.0)
    # Stays on the marker when it is cut out: at the rim of the quiet zone.
    page.text(left + 3.0, bottom + 3.0, f"{title}, this is the lower edge", 1.8)
    _draw_ruler(page, paper)
    return page


def _check_fits(whole_mm: float, size_mm: float, paper: Paper) -> None:
    room_mm = min(paper.width_mm - 2.0 * paper.margin_mm, paper.height_mm - _HEADER_MM - _FOOTER_MM)
    if whole_mm > room_mm:
        raise DoesNotFit(
            f"a marker of {size_mm:g} mm needs {whole_mm:g} mm with its quiet zone; "
            f"{paper.name} has room for {room_mm:g} mm"
        )


def _mark_corners(page: Page, left: float, bottom: float, size: float) -> None:
    """Crop marks."""
    near, far = _CROP_GAP_MM, _CROP_GAP_MM + _CROP_LENGTH_MM
    for x, outward_x in ((left, -1.0), (left + size, 1.0)):
        for y, outward_y in ((bottom, -1.0), (bottom + size, 1.0)):
            page.line(x + outward_x * near, y, x + outward_x * far, y)
            page.line(x, y + outward_y * near, x, y + outward_y * far)


def _draw_ruler(page: Page, paper: Paper) -> None:
    """100 mm with a tick at every 10 mm."""
    left, y = 0.5 * (paper.width_mm - _RULER_MM), 15.0
    page.line(left, y, left + _RULER_MM, y)
    for at in range(0, 101, 10):
        page.line(left + at, y, left + at, y + (5.0 if at in (0, 50, 100) else 3.0))
    page.text(0.5 * paper.width_mm, 10.0, "100 mm: if it measures otherwise, print again at 100 %", 2.5, "center")
