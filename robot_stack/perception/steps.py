"""A second pass over the profiles: kerbs between rings too far apart for the cone, and decks seen from outside.

Between two rings half a metre apart a kerb of 5 cm rises no more steeply than a ramp. But a ramp keeps rising, and a
kerb does not: a cell above the line of the ground before it, where the ground behind it rises less, is a
step. A deck is the opposite: cells above the cone that form one smooth surface of some length are ground on another
level, and the rise up to them is the obstacle. A slope too steep to climb is still ground: it leaves the cone
gradually, so that noise alone would decide which of its cells is a step; but no cell is off its own line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.perception.cells import DROP, EMPTY, FLOOR, STEP, TALL
from robot_stack.perception.params import GroundParams
from robot_stack.perception.polar import COUNT, DISTANCE, GROUND_M, HEIGHT, RISE, TOP, Cells

Float = NDArray[np.float32]
Int = NDArray[np.int32]
Bytes = NDArray[np.uint8]
_LINE_M = 0.3  # of ground before a step, at least; farther out three rings
_RINGS_IN_LINE = 3
_KNOWN_M = 0.2  # shorter lines give no slope
_AHEAD = 8  # cells evaluated behind the last ground
_CONTINUES = 0.45  # of the least slope that a ramp would need to keep rising
_NEAR_M = 1.8  # from the wheels
_WITNESSES = 2  # of the four directions beside it that must have a raised cell too
_GO_ON_M = 0.2  # evaluated behind a rise, at least
_SMOOTH_M = 0.06
_EVEN_SHARE = 0.8  # of the steepest ramp's slope, that a steep slope has at least: a kerb's line is flatter, or off
_EVEN_CELLS = 6
_EVEN_GAP_M = 0.2  # between two of its cells
_DECK_EDGE_M = 0.15  # that stays an obstacle if the side of the deck was not seen


@dataclass(frozen=True, slots=True)
class RingErrors:
    """Largest errors of two rings against each other; sensor_height_m: above base_link."""

    sensor_height_m: float
    range_m: float
    elevation_rad: float


def look_again(
    cells: Cells,
    start: tuple[Float, Float],
    kind: Bytes,
    free_m: Float,
    ring_spacing_rad: float,
    errors: RingErrors,
    params: GroundParams,
) -> None:
    """start: distance and height of the ground at the wheels, (sectors,) each.

    Corrects ``kind`` (sectors, rings), the cells' ground and ``free_m`` (sectors,) in place."""
    slope = np.float32(math.tan(math.radians(params.max_slope_deg)))
    rise, gap, reach = (np.float32(value) for value in (params.kerb_rise_m, params.kerb_gap_m, params.kerb_range_m))
    spacing = np.float32(ring_spacing_rad)
    sensor, bias = np.float32(errors.sensor_height_m), (np.float32(errors.range_m), np.float32(errors.elevation_rad))
    _find_steps(cells.values, cells.sectors, kind, slope, rise, gap, reach, spacing, sensor, bias, *start)
    _take_steps(cells.values, cells.sectors, kind, free_m)
    steep = np.float32(math.tan(math.radians(params.steep_slope_deg)))
    length, off = np.float32(params.steep_m), np.float32(params.steep_tolerance_m)
    _find_slopes(cells.values, cells.sectors, slope, steep, length, off, kind)
    _find_decks(cells.values, cells.sectors, slope, np.float32(params.deck_m), kind)


@compiled(error_model="numpy")
def _find_steps(
    cells: Float,
    active: Int,
    kind: Bytes,
    slope: Any,
    rise: Any,
    max_gap: Any,
    reach: Any,
    spacing: Any,
    sensor: Any,
    bias: Any,
    seed_d: Float,
    seed_z: Float,
) -> None:
    """Writes to RISE how far a cell stands above the ground before it, 0 where it is no step.

    sensor: height; bias: largest errors of range (m) and angle (rad) of two rings against each other. The range error
    acts at the angle of incidence; both look like a rise.
    """
    rings = cells.shape[1]
    node = np.empty(rings, np.int64)
    for s in active:
        row, count = cells[s], 0
        for k in range(rings):
            if kind[s, k] == FLOOR or kind[s, k] == STEP:
                if row[k, DISTANCE] > reach:
                    break
                node[count] = k
                count += 1
        back = 0
        for i in range(1, count - 1):
            k = node[i]
            if kind[s, k] != FLOOR or row[k, RISE] > 0:
                continue
            d0 = row[k, DISTANCE]
            while d0 - row[node[back + 1], DISTANCE] >= np.float32(_LINE_M):
                back += 1
            if not _may_rise(row, back, i, count, node, rise, max_gap):
                continue
            length = max(np.float32(_LINE_M), np.float32(_RINGS_IN_LINE) * spacing * (d0 * d0 + np.float32(0.5)) * 1.4)
            middle_d, middle_z, tilt, known = _line(row, i, node, length, slope)
            if known < np.float32(_KNOWN_M) and middle_d - seed_d[s] < np.float32(_NEAR_M):
                # The first rings: this line begins at the wheels.
                tilt = (middle_z - seed_z[s]) / max(middle_d - seed_d[s], np.float32(0.2))
                tilt, known = min(max(tilt, -slope), slope), np.float32(_LINE_M)
            off = row[k, HEIGHT] - (middle_z + tilt * (d0 - middle_d))
            if known < np.float32(_KNOWN_M) or off > np.float32(0.5) * rise:  # already above that line
                continue
            for ahead in range(i + 1, min(i + 1 + _AHEAD, count)):
                m = node[ahead]
                away = row[m, DISTANCE] - d0
                if away > min(max_gap, np.float32(1.2) * known):  # a line is not extrapolated far beyond its points
                    break
                over = row[m, HEIGHT] - (middle_z + tilt * (row[m, DISTANCE] - middle_d))
                error = bias[0] * min(sensor / max(row[m, DISTANCE], np.float32(0.5)), np.float32(1.0))
                error += bias[1] * row[m, DISTANCE]
                if over < rise + error or row[m, COUNT] < 3 or away <= np.float32(0.0):
                    continue
                if _goes_on(row, ahead, count, node, over, away, tilt, slope, max_gap):
                    continue
                row[m, RISE] = over


@compiled(error_model="numpy")
def _may_rise(row: Float, back: int, i: int, count: int, node: Any, rise: Any, gap: Any) -> bool:
    """A fast test, with half of the rise and a slope from two cells, that skips most even ground."""
    k = node[i]
    d0, z0 = row[k, DISTANCE], row[k, HEIGHT]
    before = node[back]
    tilt = (z0 - row[before, HEIGHT]) / max(d0 - row[before, DISTANCE], np.float32(0.05))
    for ahead in range(i + 1, min(i + 3, count)):
        m = node[ahead]
        away = row[m, DISTANCE] - d0
        if away > gap:
            break
        if row[m, HEIGHT] - z0 - tilt * away > np.float32(0.5) * rise:
            return True
    return False


@compiled(error_model="numpy")
def _line(row: Float, i: int, node: Any, length: Any, slope: Any) -> tuple[Any, Any, Any, Any]:
    """The ground up to node i: its middle, its slope (no steeper than ground can be) and its length."""
    weight, sum_d, sum_z = np.float32(0.0), np.float32(0.0), np.float32(0.0)
    end = row[node[i], DISTANCE]
    first = i
    while first >= 0 and end - row[node[first], DISTANCE] <= length:
        k = node[first]
        first -= 1
        if row[k, RISE] > 0:
            continue
        n = row[k, COUNT]
        weight += n
        sum_d += n * row[k, DISTANCE]
        sum_z += n * row[k, HEIGHT]
    middle_d, middle_z = sum_d / weight, sum_z / weight
    square, mixed = np.float32(0.0), np.float32(0.0)
    for j in range(first + 1, i + 1):
        k = node[j]
        if row[k, RISE] > 0:
            continue
        n, away = row[k, COUNT], row[k, DISTANCE] - middle_d
        square += n * away * away
        mixed += n * away * (row[k, HEIGHT] - middle_z)
    tilt = mixed / (square + weight * np.float32(1e-4))
    return middle_d, middle_z, min(max(tilt, -slope), slope), end - row[node[first + 1], DISTANCE]


@compiled(error_model="numpy")
def _goes_on(
    row: Float,
    at: int,
    count: int,
    node: Any,
    over: Any,
    away: Any,
    tilt: Any,
    slope: Any,
    gap: Any,
) -> bool:
    """True if the ground behind keeps rising like a ramp that explains the points, or if there are no points behind."""
    m = node[at]
    for after in range(at + 1, count):
        n = node[after]
        ahead = row[n, DISTANCE] - row[m, DISTANCE]
        if ahead < max(np.float32(0.5) * away, np.float32(_GO_ON_M)):
            continue
        if ahead > gap:
            return True
        growth = row[n, HEIGHT] - row[m, HEIGHT] - tilt * ahead
        return bool(growth >= np.float32(_CONTINUES) * min(over / away, slope) * ahead)
    return True


@compiled(error_model="numpy")
def _take_steps(cells: Float, active: Int, kind: Bytes, free: Float) -> None:
    """Accepts steps with a raised cell in a direction beside them."""
    sectors, rings = kind.shape
    for s in active:
        for k in range(rings):
            if kind[s, k] == EMPTY or (cells[s, k, RISE] <= np.float32(0.0) and kind[s, k] != STEP):
                continue
            d = cells[s, k, DISTANCE]
            witnesses = 0
            for other in (-2, -1, 1, 2):
                t = (s + other) % sectors
                shown = False
                for j in range(max(0, k - 4), min(rings, k + 5)):
                    raised = cells[t, j, RISE] > np.float32(0.0) or kind[t, j] == STEP or kind[t, j] == TALL
                    if raised and abs(cells[t, j, DISTANCE] - d) < np.float32(0.25):
                        shown = True
                witnesses += shown
            confirmed = witnesses >= _WITNESSES
            if not confirmed and kind[s, k] == STEP:
                kind[s, k], cells[s, k, GROUND_M] = FLOOR, cells[s, k, HEIGHT]
            elif confirmed and cells[s, k, RISE] > np.float32(0.0):
                # A cell classified by the cone keeps its height above the last ground.
                if kind[s, k] == FLOOR:
                    cells[s, k, GROUND_M] = cells[s, k, GROUND_M] - cells[s, k, RISE]
                    kind[s, k] = STEP
                if free[s] >= d:
                    free[s] = d


@compiled(error_model="numpy")
def _find_slopes(cells: Float, active: Int, slope: Any, steep: Any, length: Any, off: Any, kind: Bytes) -> None:
    """Cells above the cone that lie on an even slope with the cells before or behind them become ground."""
    rings = kind.shape[1]
    node, even = np.empty(rings, np.int64), np.empty(rings, np.bool_)
    for s in active:
        row, count, raised = cells[s], 0, False
        for k in range(rings):
            if kind[s, k] != EMPTY and kind[s, k] != DROP:
                node[count], even[count] = k, False
                count += 1
                raised |= kind[s, k] != FLOOR
        if not raised:
            continue
        for i in range(count):
            what = kind[s, node[i]]
            if what != STEP and what != TALL:
                continue
            for share in (0.5, 1.0, 0.0):  # about it, before it, behind it
                if _is_even(row, i, count, node, np.float32(share), slope, steep, length, off):
                    even[i] = True
                    break
        for i in range(count):
            if even[i]:
                kind[s, node[i]], row[node[i], GROUND_M] = FLOOR, row[node[i], HEIGHT]


@compiled(error_model="numpy")
def _is_even(
    row: Float, at: int, count: int, node: Any, share: Any, slope: Any, steep: Any, length: Any, off: Any
) -> bool:
    """True if the cells of a window form one steep line. share: of the window's length before the cell ``at``."""
    begin, end = row[node[at], DISTANCE] - share * length, row[node[at], DISTANCE] + (np.float32(1.0) - share) * length
    first, last = at, at
    while first > 0 and row[node[first - 1], DISTANCE] >= begin:
        first -= 1
    while last < count - 1 and row[node[last + 1], DISTANCE] <= end:
        last += 1
    n = last - first + 1
    if n < _EVEN_CELLS or row[node[last], DISTANCE] - row[node[first], DISTANCE] < np.float32(0.75) * length:
        return False
    middle_d, middle_z = np.float32(0.0), np.float32(0.0)
    for i in range(first, last + 1):
        k = node[i]
        if i > first and row[k, DISTANCE] - row[node[i - 1], DISTANCE] > np.float32(_EVEN_GAP_M):
            return False
        if row[k, TOP] - row[k, HEIGHT] > np.float32(_SMOOTH_M):
            return False
        middle_d += row[k, DISTANCE] / np.float32(n)
        middle_z += row[k, HEIGHT] / np.float32(n)
    square, mixed = np.float32(0.0), np.float32(0.0)
    for i in range(first, last + 1):
        away = row[node[i], DISTANCE] - middle_d
        square += away * away
        mixed += away * (row[node[i], HEIGHT] - middle_z)
    tilt = mixed / square
    if not np.float32(_EVEN_SHARE) * slope <= tilt <= steep:
        return False
    for i in range(first, last + 1):
        k = node[i]
        if abs(row[k, HEIGHT] - middle_z - tilt * (row[k, DISTANCE] - middle_d)) > off:
            return False
    return True


@compiled(error_model="numpy")
def _find_decks(cells: Float, active: Int, slope: Any, least: Any, kind: Bytes) -> None:
    """Decks become ground. The first cells of a deck stay the obstacle if it begins with a jump whose side was not
    seen."""
    rings = kind.shape[1]
    for s in active:
        first, last, before = -1, -1, -1
        jump = False
        for k in range(rings + 1):
            smooth, joined = False, False
            if k < rings:
                what = kind[s, k]
                if what == EMPTY or what == DROP:
                    continue
                high = what == TALL or what == STEP
                smooth = high and cells[s, k, TOP] - cells[s, k, HEIGHT] < np.float32(_SMOOTH_M) + slope * np.float32(
                    0.1
                )
                joined = last >= 0 and _joins(cells, s, last, k, slope, least)
            if smooth and joined:
                last = before = k
                continue
            if last > first >= 0 and cells[s, last, DISTANCE] - cells[s, first, DISTANCE] >= least:
                inside = cells[s, first, DISTANCE] + (np.float32(_DECK_EDGE_M) if jump else np.float32(0.0))
                for j in range(first, last + 1):
                    if (kind[s, j] == TALL or kind[s, j] == STEP) and cells[s, j, DISTANCE] >= inside:
                        kind[s, j], cells[s, j, GROUND_M] = FLOOR, cells[s, j, HEIGHT]
            first = last = k if smooth else -1
            if smooth:
                jump = before < 0 or (kind[s, before] == FLOOR and not _joins(cells, s, before, k, slope, least))
            before = k


@compiled(error_model="numpy")
def _joins(cells: Float, s: int, before: int, after: int, slope: Any, least: Any) -> bool:
    """True if two cells of a direction can be one surface no steeper than a ramp."""
    away = cells[s, after, DISTANCE] - cells[s, before, DISTANCE]
    rise = abs(cells[s, after, HEIGHT] - cells[s, before, HEIGHT])
    return bool(rise <= slope * away + np.float32(0.02) and away < least)
