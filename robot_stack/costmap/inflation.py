"""Cost of a place by its distance from the nearest obstacle, with Nav2's values in an OccupancyGrid.

100: an obstacle. 99: the footprint touches it whatever its heading (the inscribed circle). 1-98: it may touch it,
falling exponentially. 0: free.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.distance_field import distance_field
from robot_stack.core.robot import Footprint
from robot_stack.core.site_map import OCCUPIED, UNKNOWN

LETHAL, INSCRIBED, HIGHEST = 100, 99, 98
# Nav2 computes with 252 steps below "inscribed" and publishes them as 1-98.
_STEPS = 252
_ROUNDING_M = 1e-9


def cost(distance_m: float, inscribed_radius_m: float, scaling_per_m: float) -> int:
    """Cost at a distance from an obstacle's middle, within the inflation radius."""
    if distance_m == 0.0:
        return LETHAL
    if distance_m <= inscribed_radius_m + _ROUNDING_M:
        return INSCRIBED
    steps = int(_STEPS * math.exp(-scaling_per_m * (distance_m - inscribed_radius_m)))
    return 0 if steps == 0 else 1 + (HIGHEST - 1) * (steps - 1) // (_STEPS - 1)


def cost_table(footprint: Footprint, beyond_m: float, scaling_per_m: float, resolution_m: float) -> NDArray[np.int8]:
    """(n,) costs by squared distance in cells, up to ``beyond_m`` beyond the circumscribed radius."""
    cells = (footprint.circumscribed_m() + beyond_m) / resolution_m
    inside_m = footprint.inscribed_m()
    return np.array(
        [cost(math.sqrt(squared) * resolution_m, inside_m, scaling_per_m) for squared in range(int(cells * cells) + 1)],
        np.int8,
    )


def inflated(state: NDArray[np.int8], costs: NDArray[np.int8]) -> NDArray[np.int8]:
    """(rows, columns) costs around the occupied cells of ``state``.

    costs: by the squared distance in cells; beyond its end the cost is 0. An unknown cell gets a cost only within the
    inscribed radius.
    """
    squared = np.rint(np.square(distance_field(state == OCCUPIED), dtype=np.float64))
    out: NDArray[np.int8] = np.append(costs, np.int8(0))[np.minimum(squared, len(costs)).astype(np.intp)]
    out[(state == UNKNOWN) & (out < INSCRIBED)] = UNKNOWN
    return out
