"""Mixed pixels: a beam that hits the chair's edge and the background measures a range between the two surfaces.

There is no object. Such points are single, anywhere between both surfaces, while an object beside the chair
returns many beams from one place. They must not be stored either: they lie behind the chair's edge, where no ray
ever passes to show that the place is empty.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.core.point_cloud import Points
from robot_stack.perception.crop import UPRIGHT, ahead_of, readable
from robot_stack.perception.deskew import Attitude
from robot_stack.perception.params import MixedPixelParams
from robot_stack.perception.polar import HALF_PI, PI, angle_of
from robot_stack.perception.space.view import View

Float = NDArray[np.float32]


class ChairEdges:
    """Directions from one sensor at or right beside a return of the attached chair.

    mount: (3,) sensor in base_link; turned: (3, 3) from the sensor's axes to base_link's, None if they are the same.
    box: (6,) x0 x1 y0 y1 z0 z1 of the chair, base_link. spacing_rad: between neighbouring beams, across and along the
    rings; pi across: whatever the height.
    """

    def __init__(self, mount: Float, turned: Float | None, box: Float, spacing_rad: tuple[float, float]) -> None:
        self._mount, self._box = mount, box
        self._turn = np.eye(3, dtype=np.float32) if turned is None else turned
        # Directions of the chair's returns and the eight around each.
        self._near = np.zeros((round(math.pi / spacing_rad[0]), round(2.0 * math.pi / spacing_rad[1])), np.bool_)

    def look(self, points: Points, lean: Float = UPRIGHT) -> None:
        """points: (m,) of one message, sensor frame, m. lean: of the chair, see ``UPRIGHT``."""
        self._near[:] = False
        x, y, z = readable(points, "x", "y", "z")
        _mark(x, y, z, self._mount, self._turn, self._box, lean, self._near)

    def beside(self, xyz: Float) -> NDArray[np.bool_]:
        """(n,) of points (n, 3) of that message, base_link."""
        found = np.zeros(len(xyz), np.bool_)
        _find(np.ascontiguousarray(xyz), self._mount, self._near, found)
        return found

    def without(self, view: View) -> View:
        """A view without the points beside the chair: they are stored neither as obstacle nor as ground."""
        # The floor is levelled, the beams are not: on a ramp of 10 deg their elevations differ by as much.
        floor = view.floor[:, :3] @ Attitude.of_tilt(view.tilt).matrix().astype(np.float32)
        return replace(view, hits=view.hits[~self.beside(view.hits)], floor=view.floor[~self.beside(floor)])

    def without_sparse(self, xyz: Float, params: MixedPixelParams, points_min: int) -> Float:
        """(k, 3) of obstacle points (n, 3): without those beside the chair that are too few to be an object."""
        kept = ~self.beside(xyz)
        reach_m = np.float32(self._box[1] + params.beyond_m)
        _keep_dense(np.ascontiguousarray(xyz), reach_m, np.float32(params.cell_m), points_min, kept)
        return xyz[kept]


@compiled(error_model="numpy")
def _direction(x: Any, y: Any, z: Any, rows: int, columns: int) -> tuple[int, int]:
    """Row by elevation, column by azimuth."""
    up = angle_of(z, np.float32(math.sqrt(x * x + y * y))) + HALF_PI
    row = min(max(int(up / PI * rows), 0), rows - 1)
    column = min(max(int((angle_of(y, x) + PI) / (np.float32(2.0) * PI) * columns), 0), columns - 1)
    return row, column


@compiled(error_model="numpy")
def _mark(x: Float, y: Float, z: Float, mount: Float, turn: Float, box: Float, lean: Float, near: Any) -> None:
    rows, columns = near.shape
    for i in range(len(x)):
        dx = turn[0, 0] * x[i] + turn[0, 1] * y[i] + turn[0, 2] * z[i]
        dy = turn[1, 0] * x[i] + turn[1, 1] * y[i] + turn[1, 2] * z[i]
        dz = turn[2, 0] * x[i] + turn[2, 1] * y[i] + turn[2, 2] * z[i]
        px, py, pz = dx + mount[0], dy + mount[1], dz + mount[2]
        if box[0] <= px <= box[1] + ahead_of(pz, lean) and box[2] <= py <= box[3] and box[4] <= pz <= box[5]:
            row, column = _direction(dx, dy, dz, rows, columns)
            for r in range(max(row - 1, 0), min(row + 2, rows)):
                for c in range(column - 1, column + 2):
                    near[r, c % columns] = True


@compiled(error_model="numpy")
def _find(xyz: Float, mount: Float, near: Any, found: Any) -> None:
    rows, columns = near.shape
    for i in range(len(xyz)):
        row, column = _direction(xyz[i, 0] - mount[0], xyz[i, 1] - mount[1], xyz[i, 2] - mount[2], rows, columns)
        found[i] = near[row, column]


@compiled(error_model="numpy")
def _keep_dense(xyz: Float, reach: Any, cell: Any, least: int, kept: Any) -> None:
    """Also keeps points with ``least`` points in their cell and the eight beside it, in plan, and far points."""
    size = int(np.float32(2.0) * reach / cell) + 1
    counts = np.zeros((size + 2, size + 2), np.int32)
    for i in range(len(xyz)):
        x, y = xyz[i, 0], xyz[i, 1]
        if abs(x) < reach and abs(y) < reach:
            counts[int((x + reach) / cell) + 1, int((y + reach) / cell) + 1] += 1
    for i in range(len(xyz)):
        x, y = xyz[i, 0], xyz[i, 1]
        if kept[i]:
            continue
        if not (abs(x) < reach and abs(y) < reach):
            kept[i] = True
            continue
        row, column = int((x + reach) / cell) + 1, int((y + reach) / cell) + 1
        kept[i] = counts[row - 1 : row + 2, column - 1 : column + 2].sum() >= least
