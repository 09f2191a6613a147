"""A second look at the profiles: kerbs between rings that lie too far apart for the cone, and decks seen from outside.

Between two rings half a metre apart a kerb of 5 cm rises no more steeply than a ramp. But a ramp goes on rising, and a
kerb does not: a cell that stands above the line of the ground before it, where the ground behind it rises less, is a
step. A deck is the opposite: cells above the cone that make one smooth surface of some length are ground on another
level, and what leads up to them is the obstacle.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from robot_stack.perception.cells import DROP, EMPTY, FLOOR, STEP, TALL
from robot_stack.perception.params import GroundParams
from robot_stack.perception.polar import Cells

Float = NDArray[np.float32]
Int = NDArray[np.int32]
Bytes = NDArray[np.uint8]
_LINE_M = 0.3  # of ground before a step, at least; farther out three rings
_RINGS_IN_LINE = 3
_KNOWN_M = 0.2  # shorter lines say nothing of a slope
_AHEAD = 8  # cells looked at behind the last ground
_CONTINUES = 0.45  # of the least slope that a ramp would need: it goes on rising
_NEAR_M = 1.8  # from the wheels
_WITNESSES = 2  # of the four directions beside it that show something raised too
_GO_ON_M = 0.2  # looked at behind a rise, at least
_SMOOTH_M = 0.06


def look_again(
    cells: Cells,
    start: tuple[Float, Float],
    kind: Bytes,
    ground: Float,
    free_m: Float,
    ring_spacing_rad: float,
    params: GroundParams,
) -> None:
    """start: distance and height of the ground at the wheels, (sectors,) each.

    Corrects ``kind``, ``ground`` (sectors, rings) and ``free_m`` (sectors,) in place."""
    slope = np.float32(math.tan(math.radians(params.max_slope_deg)))
    steps = np.zeros_like(ground)
    rise, gap, reach = (np.float32(value) for value in (params.kerb_rise_m, params.kerb_gap_m, params.kerb_range_m))
    spacing = np.float32(ring_spacing_rad)
    _find_steps(cells.low, cells.height_m, cells.distance_m, kind, slope, rise, gap, reach, spacing, *start, steps)
    _take_steps(cells.height_m, cells.distance_m, steps, kind, ground, free_m)
    _find_decks(cells.height_m, cells.distance_m, cells.top_m, slope, np.float32(params.deck_m), kind, ground)


@numba.njit(cache=True, error_model="numpy")
def _find_steps(
    low: Int,
    height: Float,
    distance: Float,
    kind: Bytes,
    slope: Any,
    rise: Any,
    max_gap: Any,
    reach: Any,
    spacing: Any,
    seed_d: Float,
    seed_z: Float,
    steps: Float,
) -> None:
    """steps: (sectors, rings) how far a cell stands above the ground before it, 0 where it is no step."""
    sectors, rings = low.shape
    node = np.empty(rings, np.int64)
    for s in range(sectors):
        count = 0
        for k in range(rings):
            if kind[s, k] == FLOOR or kind[s, k] == STEP:
                if distance[s, k] > reach:
                    break
                node[count] = k
                count += 1
        back = 0
        for i in range(1, count - 1):
            k = node[i]
            if kind[s, k] != FLOOR or steps[s, k] > 0:
                continue
            d0 = distance[s, k]
            while d0 - distance[s, node[back + 1]] >= np.float32(_LINE_M):
                back += 1
            if not _may_rise(s, back, i, count, node, height, distance, rise, max_gap):
                continue
            length = max(np.float32(_LINE_M), np.float32(_RINGS_IN_LINE) * spacing * (d0 * d0 + np.float32(0.5)) * 1.4)
            middle_d, middle_z, tilt, known = _line(s, i, node, low, height, distance, steps, length, slope)
            if known < np.float32(_KNOWN_M) and middle_d - seed_d[s] < np.float32(_NEAR_M):
                # The first rings: the wheels stand on the other end of this line.
                tilt = (middle_z - seed_z[s]) / max(middle_d - seed_d[s], np.float32(0.2))
                tilt, known = min(max(tilt, -slope), slope), np.float32(_LINE_M)
            off = height[s, k] - (middle_z + tilt * (d0 - middle_d))
            if known < np.float32(_KNOWN_M) or off > np.float32(0.5) * rise:  # it stands above that line already
                continue
            for ahead in range(i + 1, min(i + 1 + _AHEAD, count)):
                m = node[ahead]
                away = distance[s, m] - d0
                if away > min(max_gap, np.float32(1.2) * known):  # a line is not believed far beyond what it is made of
                    break
                over = height[s, m] - (middle_z + tilt * (distance[s, m] - middle_d))
                if over < rise or low[s, m] < 3 or away <= np.float32(0.0):
                    continue
                if _goes_on(s, ahead, count, node, height, distance, over, away, tilt, slope, max_gap):
                    continue
                steps[s, m] = over


@numba.njit(cache=True, error_model="numpy")
def _may_rise(
    s: int, back: int, i: int, count: int, node: Any, height: Float, distance: Float, rise: Any, gap: Any
) -> bool:
    """A quick look, with half of the rise and a slope from two cells, that spares most of the work on even ground."""
    k = node[i]
    d0, z0 = distance[s, k], height[s, k]
    before = node[back]
    tilt = (z0 - height[s, before]) / max(d0 - distance[s, before], np.float32(0.05))
    for ahead in range(i + 1, min(i + 3, count)):
        m = node[ahead]
        away = distance[s, m] - d0
        if away > gap:
            break
        if height[s, m] - z0 - tilt * away > np.float32(0.5) * rise:
            return True
    return False


@numba.njit(cache=True, error_model="numpy")
def _line(
    s: int, i: int, node: Any, low: Int, height: Float, distance: Float, steps: Float, length: Any, slope: Any
) -> tuple[Any, Any, Any, Any]:
    """The ground up to node i: its middle, its slope (no steeper than ground can be) and its length."""
    weight, sum_d, sum_z = np.float32(0.0), np.float32(0.0), np.float32(0.0)
    end = distance[s, node[i]]
    first = i
    while first >= 0 and end - distance[s, node[first]] <= length:
        k = node[first]
        first -= 1
        if steps[s, k] > 0:
            continue
        n = np.float32(low[s, k])
        weight += n
        sum_d += n * distance[s, k]
        sum_z += n * height[s, k]
    middle_d, middle_z = sum_d / weight, sum_z / weight
    square, mixed = np.float32(0.0), np.float32(0.0)
    for j in range(first + 1, i + 1):
        k = node[j]
        if steps[s, k] > 0:
            continue
        n, away = np.float32(low[s, k]), distance[s, k] - middle_d
        square += n * away * away
        mixed += n * away * (height[s, k] - middle_z)
    tilt = mixed / (square + weight * np.float32(1e-4))
    return middle_d, middle_z, min(max(tilt, -slope), slope), end - distance[s, node[first + 1]]


@numba.njit(cache=True, error_model="numpy")
def _goes_on(
    s: int,
    at: int,
    count: int,
    node: Any,
    height: Float,
    distance: Float,
    over: Any,
    away: Any,
    tilt: Any,
    slope: Any,
    gap: Any,
) -> bool:
    """True if the ground behind rises on as a ramp does that explains what was seen, or if nothing is seen behind."""
    m = node[at]
    for after in range(at + 1, count):
        n = node[after]
        ahead = distance[s, n] - distance[s, m]
        if ahead < max(np.float32(0.5) * away, np.float32(_GO_ON_M)):
            continue
        if ahead > gap:
            return True
        growth = height[s, n] - height[s, m] - tilt * ahead
        return bool(growth >= np.float32(_CONTINUES) * min(over / away, slope) * ahead)
    return True


@numba.njit(cache=True, error_model="numpy")
def _take_steps(height: Float, distance: Float, steps: Float, kind: Bytes, ground: Float, free: Float) -> None:
    """Steps are believed if a direction beside them shows something raised there too."""
    sectors, rings = steps.shape
    for s in range(sectors):
        for k in range(rings):
            if steps[s, k] <= np.float32(0.0) and kind[s, k] != STEP:
                continue
            d = distance[s, k]
            witnesses = 0
            for other in (-2, -1, 1, 2):
                t = (s + other) % sectors
                shown = False
                for j in range(max(0, k - 4), min(rings, k + 5)):
                    raised = steps[t, j] > np.float32(0.0) or kind[t, j] == STEP or kind[t, j] == TALL
                    if raised and abs(distance[t, j] - d) < np.float32(0.25):
                        shown = True
                witnesses += shown
            believed = witnesses >= _WITNESSES
            if not believed and kind[s, k] == STEP:
                kind[s, k], ground[s, k] = FLOOR, height[s, k]
            elif believed and steps[s, k] > np.float32(0.0):
                # What was judged by the cone keeps its height above the last ground.
                if kind[s, k] == FLOOR:
                    ground[s, k] = ground[s, k] - steps[s, k]
                    kind[s, k] = STEP
                if free[s] >= d:
                    free[s] = d


@numba.njit(cache=True, error_model="numpy")
def _find_decks(height: Float, distance: Float, top: Float, slope: Any, least: Any, kind: Bytes, ground: Float) -> None:
    sectors, rings = kind.shape
    for s in range(sectors):
        first, last = -1, -1
        for k in range(rings + 1):
            smooth, joined = False, False
            if k < rings:
                what = kind[s, k]
                if what == EMPTY or what == DROP:
                    continue
                high = what == TALL or what == STEP
                smooth = high and top[s, k] - height[s, k] < np.float32(_SMOOTH_M) + slope * np.float32(0.1)
                if last >= 0:
                    away = distance[s, k] - distance[s, last]
                    joined = abs(height[s, k] - height[s, last]) <= slope * away + np.float32(0.02) and away < least
            if smooth and joined:
                last = k
                continue
            if last > first >= 0 and distance[s, last] - distance[s, first] >= least:
                for j in range(first, last + 1):
                    if kind[s, j] == TALL or kind[s, j] == STEP:
                        kind[s, j], ground[s, j] = FLOOR, height[s, j]
            first = last = k if smooth else -1
