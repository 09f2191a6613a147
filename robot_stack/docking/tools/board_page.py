"""The overview of a dock's board: the place of each marker's centre, seen from the approaching robot."""

from __future__ import annotations

import math

from robot_stack.core.docks import Dock, MarkerPlace
from robot_stack.docking.tools.page import Page, Paper

# Reductions a person can calculate with.
_SCALES = (1, 2, 5, 10, 20, 50, 100, 200)
_ROOM_ABOVE_MM = 40.0
_LINE_MM = 6.0


def board_page(name: str, dock: Dock, size_m: float, paper: Paper) -> Page:
    """Drawing to reduced scale with the ground, and a table in mm."""
    size_mm = 1000.0 * size_m
    table_mm = (len(dock.markers) + 4) * _LINE_MM + 20.0
    scale = _scale(dock, size_mm, paper.width_mm - 60.0, paper.height_mm - _ROOM_ABOVE_MM - table_mm)
    ground = table_mm
    middle = 0.5 * paper.width_mm
    page = Page(paper.width_mm, paper.height_mm)
    page.line(20.0, ground, paper.width_mm - 20.0, ground, 0.5)
    page.line(middle, ground - 3.0, middle, ground + (_top_mm(dock, size_mm) / scale) + 6.0, 0.1)
    page.text(20.0, paper.height_mm - 20.0, f"dock {name}: board seen by the robot ({dock.camera} camera)", 4.5)
    page.text(20.0, paper.height_mm - 30.0, f"scale 1:{scale}; markers {size_mm:g} mm wide", 3.0)
    page.text(paper.width_mm - 20.0, ground + 3.0, "ground", 2.5, "right")
    page.text(middle, ground - 6.0, "middle of the board", 2.5, "center")
    for marker_id, place in dock.markers.items():
        x, y = middle - 1000.0 * place.y_m / scale, ground + 1000.0 * place.z_m / scale
        width, height = size_mm * abs(math.cos(place.yaw_rad)) / scale, size_mm / scale
        for side in (-0.5, 0.5):
            page.line(x - 0.5 * width, y + side * height, x + 0.5 * width, y + side * height)
            page.line(x + side * width, y - 0.5 * height, x + side * width, y + 0.5 * height)
        page.arrow_up(x, y + 0.2 * height, y + 0.45 * height)
        page.blacken([(x - 0.4, y - 0.4, 0.8, 0.8)])
        page.text(x, y - 0.25 * height, str(marker_id), 0.2 * height, "center")
    for index, row in enumerate(_table(dock)):
        page.text(20.0, ground - 14.0 - index * _LINE_MM, row, 2.6)
    return page


def describe(marker_id: int, place: MarkerPlace) -> str:
    """A marker's place in words; left and right from the approaching robot."""
    across_mm, height_mm, depth_mm = -1000.0 * place.y_m, 1000.0 * place.z_m, -1000.0 * place.x_m
    side = "in the middle" if round(across_mm, 1) == 0.0 else f"{abs(across_mm):.4g} mm to the {_side(across_mm)}"
    parts = [f"marker {marker_id}: centre {side}, {height_mm:.4g} mm above the ground"]
    if round(depth_mm, 1) != 0.0:
        parts.append(
            f"{abs(depth_mm):.4g} mm {'nearer to' if depth_mm > 0.0 else 'further from'} the robot than the board"
        )
    if place.yaw_rad:
        # Positive about z: its face turns from the robot towards the robot's right.
        turned = math.degrees(place.yaw_rad)
        parts.append(f"facing {abs(turned):.4g} deg to the {'right' if turned > 0.0 else 'left'}")
    return ", ".join(parts)


def _side(across_mm: float) -> str:
    return "right" if across_mm > 0.0 else "left"


def _table(dock: Dock) -> list[str]:
    rows = [describe(marker_id, place) for marker_id, place in sorted(dock.markers.items())]
    return [*rows, "left and right as the robot sees them; all arrows up; all marker planes upright"]


def _top_mm(dock: Dock, size_mm: float) -> float:
    return max(1000.0 * place.z_m for place in dock.markers.values()) + 0.5 * size_mm


def _scale(dock: Dock, size_mm: float, width_mm: float, height_mm: float) -> int:
    """The smallest reduction at which the board and the way to the ground fit."""
    half_mm = max(1000.0 * abs(place.y_m) for place in dock.markers.values()) + 0.5 * size_mm
    least = max(2.0 * half_mm / width_mm, _top_mm(dock, size_mm) / height_mm)
    return next((scale for scale in _SCALES if scale >= least), math.ceil(least))
