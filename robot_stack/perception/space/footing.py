"""Footing for wheels and castors: the height of the ground around the robot, and the edges where it falls.

Every sensor adds its ground points to one grid in odom, as heights above the plane on which the robot started. A
height stays until it is measured again, because ground does not move. An edge is where the mean height of a patch
of cells falls by more than a ramp explains, and by more than beside it: a slope falls evenly, a crest and a foot bend.
Ground that was neither observed nor driven on is no footing, whatever rays have passed above it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import Footprint
from robot_stack.perception.params import FootingParams, SpaceParams
from robot_stack.perception.space.kernels import fill
from robot_stack.perception.space.rolling import rolled

Float = NDArray[np.float32]
Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Corner = NDArray[np.int64]
_MOST_POINTS = 4000
_APART = 3  # cells between the middles of two patches of 3 x 3 that share no cell
_DIAGONALLY = 2
_LEAST = np.float32(6.0)  # returns that make a patch
_CELLS = 4  # of nine, that must be known
_ALIKE_M = np.float32(0.05)
_LIMIT_M, _MORE_M, _STEEP_M, _SLOPE, _SIGMA_M, _GAP, _MOST = range(7)


class Footing:
    """Call ``observe`` with the floor of every view, then query. Poses are base_link in odom."""

    def __init__(self, params: FootingParams, space: SpaceParams) -> None:
        self._params, self._cell_m = params, space.cell_m
        count = round(space.size_m / space.cell_m)
        self._corner = np.zeros(2, np.int64)
        self._ground_m = np.zeros((count, count), np.float32)
        self._returns = np.zeros((count, count), np.float32)
        self._known = np.zeros((count, count), np.bool_)
        self._drop = np.zeros((count, count), np.bool_)
        self._pose: Pose2 | None = None
        self._own: Footprint | None = None
        self._margin_m = space.attach_margin_m
        self._up_m, self._rise = 0.0, 0.0
        self._steepest = math.tan(math.radians(params.slope_deg))
        self._points = np.empty((_MOST_POINTS, 3), np.float32)
        self._limits = np.array(
            [
                params.fall_m,
                params.more_m,
                params.steep_m,
                math.tan(math.radians(params.slope_deg)) * space.cell_m,
                params.sigma_m,
                params.gap_m / space.cell_m,
                params.returns_max,
            ],
            np.float32,
        )

    def forget(self) -> None:
        """Clears all heights."""
        self._returns[:], self._known[:], self._drop[:] = 0.0, False, False
        self._pose, self._up_m, self._rise = None, 0.0, 0.0

    def observe(self, floor: Float, tilt: tuple[float, float], pose: Pose2, own: Footprint) -> None:
        """floor: (n, 4) x, y, z of ground, base_link levelled, m, and of how many returns, see ``View``. tilt: by
        how much base_link's x and y axes rise. own: the footprint in force; what is beneath it, the robot stands on."""
        self._move_to(pose, tilt)
        self._rise = tilt[0]
        at = _array(pose)
        if own is not self._own:
            # Heights measured there before the chair was attached may be of the chair.
            if self._own is not None:
                fill(self._returns, self._corner, self._cell_m, at, _rectangle(own, self._margin_m), np.float32(0.0))
            self._own = own
        cells, most = (self._ground_m, self._returns, self._known), self._limits[_MOST]
        _lay(*cells, self._corner, self._cell_m, at, self._up_m, floor, most)
        fill(self._known, self._corner, self._cell_m, at, _rectangle(own, 0.0), True)

    def edges(self, pose: Pose2) -> Float:
        """(n, 3) base_link at ``pose``: where the ground falls around the robot, and not beneath it, z 0."""
        half, reach = len(self._drop) // 2, round(self._params.range_m / self._cell_m)
        near = slice(max(half - reach, 0), half + reach)
        self._drop[:] = False
        _find_edges(self._ground_m[near, near], self._returns[near, near], self._limits, self._drop[near, near])
        if self._own is not None:
            fill(self._drop, self._corner, self._cell_m, _array(pose), _rectangle(self._own, 0.0), False)
        return self._listed(self._drop, pose)

    def bends(self, pose: Pose2, from_m: float) -> float:
        """By how much less the ground rises along base_link's x axis beneath the footprint, from ``from_m`` on, than
        base_link; at most the steepest ramp. 0 where it rises more, or is unknown."""
        if self._own is None:
            return 0.0
        rect = _rectangle(self._own, 0.0)
        rect[0] = from_m
        rise = _rise(self._ground_m, self._returns, self._corner, self._cell_m, _array(pose), rect)
        return min(max(self._rise - rise, 0.0), self._steepest) if math.isfinite(rise) else 0.0

    @property
    def drop(self) -> Mask:
        """(rows, columns) the cells of the last call of ``edges``."""
        return self._drop

    def ends(self, pose: Pose2) -> Float:
        """(n, 3) base_link at ``pose``: where known footing ends, z 0, ``reach_m`` beyond it: gaps smaller than
        twice that are no hole."""
        found = np.zeros_like(self._known)
        _find_ends(self._known, round(self._params.reach_m / self._cell_m), found)
        return self._listed(found, pose)

    def _listed(self, cells: Mask, pose: Pose2) -> Float:
        rows, columns = np.nonzero(cells)
        x = (columns + self._corner[0] + 0.5) * self._cell_m - pose.x
        y = (rows + self._corner[1] + 0.5) * self._cell_m - pose.y
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        return np.stack([c * x + s * y, c * y - s * x, np.zeros_like(x)], axis=1).astype(np.float32)

    def _move_to(self, pose: Pose2, tilt: tuple[float, float]) -> None:
        before = self._pose
        if before is not None:
            step = pose.relative_to(before)
            self._up_m += tilt[0] * step.x + tilt[1] * step.y
        self._pose = pose
        half = len(self._drop) // 2
        corner = np.array(
            [math.floor(pose.x / self._cell_m) - half, math.floor(pose.y / self._cell_m) - half], np.int64
        )
        columns, rows = (int(step) for step in corner - self._corner)
        self._corner = corner
        if rows or columns:
            self._ground_m = rolled(self._ground_m, rows, columns, 0.0)
            self._returns = rolled(self._returns, rows, columns, 0.0)
            self._known = rolled(self._known, rows, columns, 0.0)
            self._drop = rolled(self._drop, rows, columns, 0.0)


def _array(pose: Pose2) -> Floats:
    return np.array([pose.x, pose.y, math.cos(pose.yaw), math.sin(pose.yaw)])


def _rectangle(footprint: Footprint, margin_m: float) -> Floats:
    half_m = 0.5 * footprint.width_m + margin_m
    return np.array([footprint.rear_m - margin_m, footprint.front_m + margin_m, half_m])


@compiled(error_model="numpy")
def _lay(
    ground: Float,
    returns: Float,
    known: Any,
    corner: Corner,
    cell_m: float,
    pose: Floats,
    up_m: float,
    floor: Float,
    most: Any,
) -> None:
    """Running means of the measured heights, over the last ``most`` returns."""
    rows, columns = ground.shape
    for i in range(len(floor)):
        x, y = floor[i, 0], floor[i, 1]
        column = math.floor((pose[0] + pose[2] * x - pose[3] * y) / cell_m - corner[0])
        row = math.floor((pose[1] + pose[3] * x + pose[2] * y) / cell_m - corner[1])
        if not (0 <= row < rows and 0 <= column < columns):
            continue
        known[row, column] = True
        if floor[i, 3] == np.float32(0.0):
            continue
        count = min(returns[row, column] + floor[i, 3], most)
        share = min(floor[i, 3] / count, np.float32(1.0))
        ground[row, column] += share * (floor[i, 2] + np.float32(up_m) - ground[row, column])
        returns[row, column] = count


@compiled(error_model="numpy")
def _rise(ground: Float, returns: Float, corner: Corner, cell_m: float, pose: Floats, rect: Floats) -> float:
    """Slope along base_link's x axis of the line of least squares through the heights in a rectangle: rear, front, half
    width in base_link, m. NaN unless heights are known in half of its cells."""
    rows, columns = ground.shape
    reach = int(math.hypot(max(rect[1], -rect[0]), rect[2]) / cell_m) + 2
    at_row, at_column = math.floor(pose[1] / cell_m) - corner[1], math.floor(pose[0] / cell_m) - corner[0]
    known, cells, sum_x, sum_z, sum_xx, sum_xz = 0, 0, 0.0, 0.0, 0.0, 0.0
    for row in range(max(at_row - reach, 0), min(at_row + reach + 1, rows)):
        dy = (row + corner[1] + 0.5) * cell_m - pose[1]
        for column in range(max(at_column - reach, 0), min(at_column + reach + 1, columns)):
            dx = (column + corner[0] + 0.5) * cell_m - pose[0]
            x, y = pose[2] * dx + pose[3] * dy, pose[2] * dy - pose[3] * dx
            if not (rect[0] <= x <= rect[1] and abs(y) <= rect[2]):
                continue
            cells += 1
            if returns[row, column] > np.float32(0.0):
                z = ground[row, column]
                known += 1
                sum_x, sum_z, sum_xx, sum_xz = sum_x + x, sum_z + z, sum_xx + x * x, sum_xz + x * z
    spread = known * sum_xx - sum_x * sum_x
    if 2 * known < cells or spread <= 0.0:
        return math.nan
    return (known * sum_xz - sum_x * sum_z) / spread


@compiled(error_model="numpy")
def _patches(ground: Float, returns: Float, mean: Float, count: Float) -> None:
    """Mean height and number of returns of the 3 x 3 cells around each; too few cells make no patch.

    Cells far from the median are left out: at the chair's edges its points mix with the ground behind it.
    """
    rows, columns = ground.shape
    sorted_m = np.empty(9, np.float32)
    for row in range(1, rows - 1):
        for column in range(1, columns - 1):
            known, low, high = 0, np.float32(np.inf), np.float32(-np.inf)
            total, sum_m = np.float32(0.0), np.float32(0.0)
            for r in range(row - 1, row + 2):
                for c in range(column - 1, column + 2):
                    if returns[r, c] > np.float32(0.0):
                        known += 1
                        low, high = min(low, ground[r, c]), max(high, ground[r, c])
                        total += returns[r, c]
                        sum_m += returns[r, c] * ground[r, c]
            if known < _CELLS:
                continue
            if high - low > _ALIKE_M:
                middle = _median(ground, returns, row, column, sorted_m)
                total, sum_m = np.float32(0.0), np.float32(0.0)
                for r in range(row - 1, row + 2):
                    for c in range(column - 1, column + 2):
                        if returns[r, c] > np.float32(0.0) and abs(ground[r, c] - middle) <= _ALIKE_M:
                            total += returns[r, c]
                            sum_m += returns[r, c] * ground[r, c]
            count[row, column], mean[row, column] = total, sum_m / total


@compiled(error_model="numpy")
def _median(ground: Float, returns: Float, row: int, column: int, sorted_m: Float) -> Any:
    """Median of the known heights in the 3 x 3 cells around one; sorted_m: (9,) memory."""
    known = 0
    for r in range(row - 1, row + 2):
        for c in range(column - 1, column + 2):
            if returns[r, c] > np.float32(0.0):
                k, height = known, ground[r, c]
                while k > 0 and sorted_m[k - 1] > height:
                    sorted_m[k] = sorted_m[k - 1]
                    k -= 1
                sorted_m[k] = height
                known += 1
    return sorted_m[known // 2]


@compiled(error_model="numpy")
def _find_edges(ground: Float, returns: Float, p: Float, drop: Any) -> None:
    """Compares each patch with the next one that is known, along rows, columns and both diagonals."""
    rows, columns = ground.shape
    mean, count = np.zeros_like(ground), np.zeros_like(ground)
    _patches(ground, returns, mean, count)
    across = np.full(columns, -1, np.int64)  # of each column, the nearest known patch in a later row
    for row in range(rows - 2, 0, -1):
        along = -1  # the nearest known patch in a later column
        for column in range(columns - 2, 0, -1):
            if count[row, column] < _LEAST:
                continue
            for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
                stride = _DIAGONALLY if dr and dc else _APART
                r, c, hidden = row + stride * dr, column + stride * dc, 0
                if r >= rows or not 0 <= c < columns:
                    continue
                if count[r, c] < _LEAST:
                    if dr and dc:
                        continue
                    beyond = along if dc else across[column]
                    hidden = beyond - (c if dc else r)
                    if beyond < 0 or not 0 < hidden <= p[_GAP]:
                        continue
                    r, c = (row, beyond) if dc else (beyond, column)
                fall = mean[row, column] - mean[r, c]
                if abs(fall) <= p[_LIMIT_M]:
                    continue
                width = np.float32(math.sqrt(2.0)) if dr and dc else np.float32(1.0)
                ramp = np.float32(hidden) * width * p[_SLOPE]
                if fall > 0.0:
                    drop[row, column] |= _falls(mean, count, row, column, r, c, stride * dr, stride * dc, ramp, p)
                else:
                    drop[r, c] |= _falls(mean, count, r, c, row, column, -stride * dr, -stride * dc, ramp, p)
            along, across[column] = column, row


@compiled(error_model="numpy")
def _falls(
    mean: Float, count: Float, r0: int, c0: int, r1: int, c1: int, dr: int, dc: int, ramp: Any, p: Float
) -> bool:
    """From one patch to another, in the direction (dr, dc). ramp: what one explains on what is hidden between."""
    fall = mean[r0, c0] - mean[r1, c1] - ramp
    noise = p[_SIGMA_M] * math.sqrt(np.float32(1.0) / count[r0, c0] + np.float32(1.0) / count[r1, c1])
    if fall > p[_STEEP_M] + noise:
        return True
    before = _step(mean, count, r0 - dr, c0 - dc, r0, c0)
    behind = _step(mean, count, r1, c1, r1 + dr, c1 + dc)
    return bool(fall > p[_LIMIT_M] + noise and fall - max(before, behind) > p[_MORE_M] + noise)


@compiled(error_model="numpy")
def _step(mean: Float, count: Float, r0: int, c0: int, r1: int, c1: int) -> Any:
    """Fall of the ground from one patch to another, 0 where it rises or either is unknown."""
    rows, columns = mean.shape
    inside = min(r0, r1, c0, c1) >= 0 and max(r0, r1) < rows and max(c0, c1) < columns
    if not inside or count[r0, c0] < _LEAST or count[r1, c1] < _LEAST:
        return np.float32(0.0)
    return max(mean[r0, c0] - mean[r1, c1], np.float32(0.0))


@compiled(error_model="numpy")
def _find_ends(known: Any, reach: int, found: Any) -> None:
    """Cells right beside those within ``reach`` cells of known ones, in rows and columns."""
    rows, columns = known.shape
    along, near = np.zeros_like(known), np.zeros_like(known)
    for row in range(rows):
        last = -rows - columns
        for column in range(columns):
            if known[row, column]:
                last = column
            along[row, column] |= column - last <= reach
        last = 2 * (rows + columns)
        for column in range(columns - 1, -1, -1):
            if known[row, column]:
                last = column
            along[row, column] |= last - column <= reach
    for column in range(columns):
        last = -rows - columns
        for row in range(rows):
            if along[row, column]:
                last = row
            near[row, column] |= row - last <= reach
        last = 2 * (rows + columns)
        for row in range(rows - 1, -1, -1):
            if along[row, column]:
                last = row
            near[row, column] |= last - row <= reach
    for row in range(1, rows - 1):
        for column in range(1, columns - 1):
            if not near[row, column]:
                beside = near[row - 1, column] or near[row + 1, column]
                found[row, column] = beside or near[row, column - 1] or near[row, column + 1]
