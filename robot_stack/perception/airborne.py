"""Returns too few to be a thing: drops, flakes and dust in the air, and single returns of whatever else.

A drop returns once. How often a thing returns follows from its size, its distance and the angles between the sensor's
beams: near the robot, where most of what is in the air is seen, a thing as small as a fist returns hundreds of times.
So a point is believed if its column holds as many as the smallest thing of interest would return from there: radius
outlier removal with a number that goes with the distance (Charron et al. 2018 let the radius do so), in a grid, not in
a search tree. It asks neither for intensity, which no two devices tell alike and a black coat has none of, nor for the
sweep before: what is believed is so at once. What is too little to be a thing, but not by far, keeps what was there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.range_sensor import RangeSensor
from robot_stack.perception.params import ObstacleParams
from robot_stack.perception.voxel import whole_below

Float = NDArray[np.float32]
_FULL = 250  # a cell counts no further; more than anything asks for


@dataclass(frozen=True, slots=True)
class Crowd:
    """How many returns make a thing, for one sensor.

    sensor_m: (3,) base_link. returns_m2: so many at 1 m. They are sought in a column of cell_m x cell_m and the eight
    around it; least, most: whatever the distance. doubt: share of them that may be a thing of which little returns.
    range_m: from base_link in plan, farther points are left out.
    """

    sensor_m: Float
    returns_m2: float
    cell_m: float
    least: int
    most: int
    doubt: float
    range_m: float

    def split(self, xyz: Float) -> tuple[Float, Float]:
        """Of the points (n, 3), base_link, within the range: those that are things, and those that may be."""
        side = 2 * math.ceil(self.range_m / self.cell_m) + 3
        things, doubtful = np.empty_like(xyz), np.empty_like(xyz)
        sizes = np.float32(self.range_m), np.float32(self.cell_m), np.float32(self.returns_m2)
        counts = self.least, self.most, np.float32(self.doubt)
        found, left = _split(xyz, self.sensor_m, *sizes, *counts, side, things, doubtful)
        return things[:found], doubtful[:left]


def crowd_of(sensor: RangeSensor, params: ObstacleParams, range_m: float) -> Crowd:
    """The smallest thing is ``smallest_m2`` towards the sensor, which has a beam for each so much of its view."""
    beam_sr = sensor.ring_spacing_rad * math.radians(sensor.span_deg) / sensor.columns
    mount = np.array(sensor.xyz_m, np.float32)
    few, many = params.neighbours_min, params.neighbours_max
    least = params.smallest_m2 / beam_sr
    return Crowd(mount, least, params.neighbourhood_m, few, many, params.doubt_share, range_m)


@numba.njit(cache=True, error_model="numpy")
def _split(
    xyz: Float,
    sensor: Float,
    reach: Any,
    size: Any,
    returns: Any,
    least: int,
    most: int,
    doubt: Any,
    side: int,
    things: Float,
    doubtful: Float,
) -> tuple[int, int]:
    counts = np.zeros((side, side), np.uint8)
    middle, per_m, reach2 = side // 2, np.float32(1.0) / size, reach * reach
    for i in range(len(xyz)):
        x, y = xyz[i, 0], xyz[i, 1]
        if x * x + y * y <= reach2:
            a, b = whole_below(x * per_m) + middle, whole_below(y * per_m) + middle
            if counts[a, b] < _FULL:
                counts[a, b] += 1
    found, left = 0, 0
    for i in range(len(xyz)):
        x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        if not x * x + y * y <= reach2:
            continue
        a, b = whole_below(x * per_m) + middle, whole_below(y * per_m) + middle
        total = int(counts[a, b])
        needed = np.float32(most)
        enough = bool(total >= most)
        if not enough:
            dx, dy, dz = x - sensor[0], y - sensor[1], z - sensor[2]
            needed = min(max(returns / (dx * dx + dy * dy + dz * dz), np.float32(least)), np.float32(most))
            if total < needed:
                total = 0
                for k in range(a - 1, a + 2):
                    total += int(counts[k, b - 1]) + int(counts[k, b]) + int(counts[k, b + 1])
            enough = bool(total >= needed)
        if enough:
            things[found, 0], things[found, 1], things[found, 2] = x, y, z
            found += 1
        elif np.float32(total) >= doubt * needed:
            doubtful[left, 0], doubtful[left, 1], doubtful[left, 2] = x, y, z
            left += 1
    return found, left
