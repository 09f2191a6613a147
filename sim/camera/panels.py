"""The flat panels that carry the markers, as arrays for the kernel.

Panel frame: u to the right and v up seen from the front, z out of it, origin in the middle of its markers.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.docks import Docks, MarkerPlace
from sim.camera.conditions import Conditions
from sim.camera.params import BoardPaint

Array = NDArray[np.float64]
QUIET_CELLS = 1
DIRT_PIXELS = 64
_SAME_PLANE_M, _SAME_ANGLE = 1e-6, 1e-9


@dataclass(frozen=True, slots=True)
class Panel:
    """One panel.

    dock: id of the dock it belongs to. pose: (4, 4) in the dock frame. rect: (4,) u_min, u_max, v_min, v_max in m.
    ids: markers on it. grids: (m, 3) left edge and upper edge of each marker's quiet zone in m, and cells per metre.
    black: (m, n, n) True where a cell is black, quiet zone included, first row on top.
    """

    dock: str
    pose: Array
    rect: Array
    ids: tuple[int, ...]
    grids: Array
    black: NDArray[np.bool_]

    def corners(self) -> Array:
        """(4, 3) in the panel frame, m."""
        left, right, low, high = self.rect
        return np.array([[left, high, 0.0], [right, high, 0.0], [right, low, 0.0], [left, low, 0.0]])

    def paint(self, board: BoardPaint, conditions: Conditions) -> NDArray[np.float32]:
        """(m, n, n) reflectances of the cells."""
        cells = np.where(self.black, board.black, board.white).astype(np.float32)
        for index, marker in enumerate(self.ids):
            if marker in conditions.covered:
                cells[index] = board.cover
        return cells

    def dirt(self, conditions: Conditions, seed: int) -> NDArray[np.float32]:
        """(m, k, k) share of dirt over each marker and its quiet zone, first row on top; (0, 0, 0) if all are clean."""
        if not any(conditions.dirt.get(marker) for marker in self.ids):
            return np.zeros((0, 0, 0), np.float32)
        return np.stack([_blotches(marker, conditions.dirt.get(marker, 0.0), seed) for marker in self.ids])


def build_panels(docks: Docks, board: BoardPaint) -> list[Panel]:
    """Every panel of every dock; markers that lie in one plane share a panel."""
    found = []
    for name, dock in docks.docks.items():
        planes: list[dict[int, MarkerPlace]] = []
        for marker, place in dock.markers.items():
            plane = next((p for p in planes if _same_plane(next(iter(p.values())), place)), None)
            if plane is None:
                planes.append({marker: place})
            else:
                plane[marker] = place
        found += [_panel(name, plane, docks, board) for plane in planes]
    return found


def _same_plane(one: MarkerPlace, other: MarkerPlace) -> bool:
    a, b = one.pose(), other.pose()
    apart = abs(float((b[:3, 3] - a[:3, 3]) @ a[:3, 2]))
    return apart < _SAME_PLANE_M and float(a[:3, 2] @ b[:3, 2]) > 1.0 - _SAME_ANGLE


def _panel(dock: str, markers: dict[int, MarkerPlace], docks: Docks, board: BoardPaint) -> Panel:
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, docks.dictionary))
    bits = int(dictionary.markerSize) + 2
    cell_m = docks.marker_size_m / bits
    pose = next(iter(markers.values())).pose()
    pose[:3, 3] = np.mean([place.pose()[:3, 3] for place in markers.values()], axis=0)
    inverse = np.linalg.inv(pose)
    places = np.array([(inverse @ place.pose())[:2, 3] for place in markers.values()])
    half = 0.5 * docks.marker_size_m + QUIET_CELLS * cell_m
    rim = half + board.margin_m
    low, high = places.min(axis=0) - rim, places.max(axis=0) + rim
    grids = np.c_[places[:, 0] - half, places[:, 1] + half, np.full(len(places), 1.0 / cell_m)]
    black = np.zeros((len(markers), bits + 2 * QUIET_CELLS, bits + 2 * QUIET_CELLS), bool)
    for index, marker in enumerate(markers):
        image = cv2.aruco.generateImageMarker(dictionary, marker, bits)  # one pixel a cell
        black[index, QUIET_CELLS:-QUIET_CELLS, QUIET_CELLS:-QUIET_CELLS] = image < 128
    return Panel(dock, pose, np.array([low[0], high[0], low[1], high[1]]), tuple(markers), grids, black)


def _blotches(marker: int, share: float, seed: int) -> NDArray[np.float32]:
    """(k, k) soft blotches that cover about ``share`` of a marker; the same ones for the same seed, growing with it."""
    mask = np.zeros((DIRT_PIXELS, DIRT_PIXELS), np.float32)
    if share <= 0.0:
        return mask
    random = np.random.default_rng([seed, marker])
    rough = cv2.GaussianBlur(random.standard_normal(mask.shape).astype(np.float32), (0, 0), DIRT_PIXELS / 12)
    level = np.quantile(rough, 1.0 - share)
    soft = 0.25 * float(rough.std())
    return np.asarray(np.clip(0.5 + (rough - level) / soft, 0.0, 1.0), dtype=np.float32)
