"""Boards in the marker detector: the markers of each board, and the places of their corners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.docks import Docks, board_corners, marker_corners

Array = NDArray[np.float64]

_GAUSS = 0.5 / np.sqrt(3.0)  # of a side's length, from its middle


@dataclass(frozen=True, slots=True)
class Board:
    """Markers with known places in one frame (a dock's, or a single marker's own).

    corners: (4, 3) of each marker, m. places: (4, 4) of each marker. up: (3,) axis about which the yaw is counted.
    """

    name: str
    corners: dict[int, Array]
    places: dict[int, Array]
    up: Array


def gauss_points(corners: Array) -> Array:
    """(8, d) Gauss points of the four sides of a marker with (4, d) corners, two for each side."""
    following = np.roll(corners, -1, axis=0)
    middle, along = 0.5 * (corners + following), following - corners
    return np.stack([middle - _GAUSS * along, middle + _GAUSS * along], axis=1).reshape(8, -1)


class Boards:
    """The boards of all docks; a marker of no dock is a board of its own."""

    def __init__(self, docks: Docks) -> None:
        self._size_m = docks.marker_size_m
        self._boards = {
            marker: board
            for name, dock in docks.docks.items()
            for board in [
                Board(
                    name,
                    board_corners(dock.markers, docks.marker_size_m),
                    {marker: place.pose() for marker, place in dock.markers.items()},
                    np.array([0.0, 0.0, 1.0]),
                )
            ]
            for marker in dock.markers
        }

    def of(self, marker: int) -> Board:
        """The board that carries a marker."""
        board = self._boards.get(marker)
        return board if board is not None else self._single(marker)

    def _single(self, marker: int) -> Board:
        corners = marker_corners(self._size_m)
        return Board(f"marker {marker}", {marker: corners}, {marker: np.eye(4)}, np.array([0.0, 1.0, 0.0]))
