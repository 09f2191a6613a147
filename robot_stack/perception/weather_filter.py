"""Removes returns too few to be an obstacle: drops, flakes and dust in the air, and other single returns.

A drop returns once. The number of returns of an object follows from its size, its distance and the angles between the
sensor's beams: near the robot, where most airborne particles are measured, a fist-sized object returns hundreds of
times. So a point is kept if its column holds as many returns as the smallest relevant object would give there: radius
outlier removal with a count that depends on the distance (Charron et al. 2018 vary the radius instead), on a grid
instead of a search tree. Sun returns scattered over the column's height are not obstacles, so only returns a few rings
above or below count, as those of a low stump. The filter uses no intensity, which differs between devices and is near
zero for a black coat, and no earlier sweep: a point is accepted at once. A column with somewhat fewer returns does
not add an obstacle, but keeps an existing one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.core.range_sensor import RangeSensor
from robot_stack.perception.params import ObstacleParams
from robot_stack.perception.voxel import whole_below

Float = NDArray[np.float32]
_FULL = 250  # a cell counts no further; more than any required number
_PLENTY = 4  # times the required number count at any height: a leg of 5 cm has six times
_ASKED, _CHAINED = 1, 2


@dataclass(frozen=True, slots=True)
class Crowd:
    """Number of returns that make an obstacle, for one sensor.

    sensor_m: (3,) base_link. returns_m2: required number at 1 m. They are counted in a column of cell_m x cell_m and
    the eight around it, at most rise_rad above or below as seen from the sensor; least, most: bounds at any distance.
    doubt: share of them, at any height, that keeps an existing obstacle.
    range_m: from base_link in plan, farther points are left out.
    """

    sensor_m: Float
    returns_m2: float
    cell_m: float
    rise_rad: float
    least: int
    most: int
    doubt: float
    range_m: float

    def split(self, xyz: Float) -> tuple[Float, Float]:
        """Splits points (n, 3), base_link, within the range: obstacles, and possible obstacles."""
        side = 2 * math.ceil(self.range_m / self.cell_m) + 3
        things, doubtful = np.empty_like(xyz), np.empty_like(xyz)
        sizes = (
            np.float32(self.range_m),
            np.float32(self.cell_m),
            np.float32(self.rise_rad),
            np.float32(self.returns_m2),
        )
        counts = self.least, self.most, np.float32(self.doubt)
        found, left = _split(xyz, self.sensor_m, *sizes, *counts, side, things, doubtful)
        return things[:found], doubtful[:left]


def crowd_of(sensor: RangeSensor, params: ObstacleParams, range_m: float) -> Crowd:
    """The smallest object shows ``smallest_m2`` to the sensor; its returns follow from the solid angle of a beam."""
    beam_sr = sensor.ring_spacing_rad * math.radians(sensor.span_deg) / sensor.columns
    mount = np.array(sensor.xyz_m, np.float32)
    few, many = params.neighbours_min, params.neighbours_max
    least = params.smallest_m2 / beam_sr
    rise_rad = params.neighbour_rings * sensor.ring_spacing_rad
    return Crowd(mount, least, params.neighbourhood_m, rise_rad, few, many, params.doubt_share, range_m)


@compiled(error_model="numpy")
def _split(
    xyz: Float,
    sensor: Float,
    reach: Any,
    size: Any,
    rise: Any,
    returns: Any,
    least: int,
    most: int,
    doubt: Any,
    side: int,
    things: Float,
    doubtful: Float,
) -> tuple[int, int]:
    counts, unsure = np.zeros((side, side), np.uint8), np.empty(len(xyz), np.int32)
    middle, per_m, reach2 = side // 2, np.float32(1.0) / size, reach * reach
    for i in range(len(xyz)):
        x, y = xyz[i, 0], xyz[i, 1]
        if x * x + y * y <= reach2:
            a, b = whole_below(x * per_m) + middle, whole_below(y * per_m) + middle
            if counts[a, b] < _FULL:
                counts[a, b] += 1
    found, left, asked = 0, 0, 0
    for i in range(len(xyz)):
        x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        if not x * x + y * y <= reach2:
            continue
        a, b = whole_below(x * per_m) + middle, whole_below(y * per_m) + middle
        total = int(counts[a, b])
        needed = np.float32(most)
        enough = bool(total >= most)
        if not enough:
            needed = _needed(xyz[i], sensor, returns, least, most)
            if total < np.float32(_PLENTY) * needed:
                total = 0
                for k in range(a - 1, a + 2):
                    total += int(counts[k, b - 1]) + int(counts[k, b]) + int(counts[k, b + 1])
            enough = bool(total >= needed)
        if enough and total < min(np.float32(_PLENTY) * needed, np.float32(most)):
            unsure[asked] = i
            asked += 1
        elif enough:
            things[found, 0], things[found, 1], things[found, 2] = x, y, z
            found += 1
        elif np.float32(total) >= doubt * needed:
            doubtful[left, 0], doubtful[left, 1], doubtful[left, 2] = x, y, z
            left += 1
    if asked == 0:
        return found, left
    together = _together(xyz, unsure[:asked], sensor, per_m, rise, size, returns, least, most, counts)
    for k in range(asked):
        i = unsure[k]
        if together[k]:
            things[found, 0], things[found, 1], things[found, 2] = xyz[i, 0], xyz[i, 1], xyz[i, 2]
            found += 1
        else:
            doubtful[left, 0], doubtful[left, 1], doubtful[left, 2] = xyz[i, 0], xyz[i, 1], xyz[i, 2]
            left += 1
    return found, left


@compiled(error_model="numpy", inline="always")
def _needed(point: Float, sensor: Float, returns: Any, least: int, most: int) -> Any:
    dx, dy, dz = point[0] - sensor[0], point[1] - sensor[1], point[2] - sensor[2]
    return min(max(returns / (dx * dx + dy * dy + dz * dz), np.float32(least)), np.float32(most))


@compiled(error_model="numpy")
def _together(
    xyz: Float,
    unsure: NDArray[np.int32],
    sensor: Float,
    per_m: Any,
    rise: Any,
    lowest: Any,
    returns: Any,
    least: int,
    most: int,
    marks: NDArray[np.uint8],
) -> NDArray[np.bool_]:
    """Keeps the points with the required number of returns near their own height.

    unsure: (k,) rows of xyz. lowest: height range of the counted returns, m. marks: a grid to be overwritten.
    """
    middle = len(marks) // 2
    marks[:] = 0
    for i in unsure:
        a, b = whole_below(xyz[i, 0] * per_m) + middle, whole_below(xyz[i, 1] * per_m) + middle
        marks[a - 1 : a + 2, b - 1 : b + 2] = _ASKED
    newest, before = np.empty(marks.shape, np.int32), np.empty(len(xyz), np.int32)  # a chain of points in each cell
    reach = np.float32(middle - 1)
    for i in range(len(xyz)):
        x, y = xyz[i, 0] * per_m, xyz[i, 1] * per_m
        if not (abs(x) < reach and abs(y) < reach):
            continue
        a, b = whole_below(x) + middle, whole_below(y) + middle
        if marks[a, b] > 0:
            before[i] = newest[a, b] if marks[a, b] == _CHAINED else -1
            newest[a, b], marks[a, b] = i, _CHAINED
    together = np.zeros(len(unsure), np.bool_)
    for k in range(len(unsure)):
        point = xyz[unsure[k]]
        dx, dy, dz = point[0] - sensor[0], point[1] - sensor[1], point[2] - sensor[2]
        up = max(rise * np.sqrt(dx * dx + dy * dy + dz * dz), lowest)
        needed = _needed(point, sensor, returns, least, most)
        a, b = whole_below(point[0] * per_m) + middle, whole_below(point[1] * per_m) + middle
        near = 0
        for c in range(a - 1, a + 2):
            for d in range(b - 1, b + 2):
                i = newest[c, d] if marks[c, d] == _CHAINED else -1
                while i >= 0 and near < needed:
                    near += abs(xyz[i, 2] - point[2]) <= up
                    i = before[i]
        together[k] = near >= needed
    return together
