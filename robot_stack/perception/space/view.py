"""One view of one sensor, as input of the model of the space: returns, and the free space along its rays.

Rays are stored by direction around the sensor and by distance: the height of the lowest ray that passed a place on its
way to a return. A beam without a return has passed nowhere, unless its sensor guarantees it: objects that are too
near, black or of glass return nothing either.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.core.geometry import Pose2
from robot_stack.perception.cells import DROP, EMPTY, FLOOR, STEP, TALL
from robot_stack.perception.ground import Profile
from robot_stack.perception.polar import COUNT, DISTANCE, GROUND_M, HEIGHT, TOP, PolarGrid, Sorted

Float = NDArray[np.float32]
BIN_M = 0.05  # of the distances
Mask = NDArray[np.bool_]
_NOTHING: Float = np.empty((0, 3), np.float32)
_NO_FLOOR: Float = np.empty((0, 4), np.float32)
_AT_ONCE = np.zeros(1)
_MOST_FLOOR = 60_000
_RINGS = np.float32(2.2)  # allows for one missing ring of ground
RISE_M = 0.10  # assumed height of an object above the hit of a single beam
_FLAT_M = np.float32(0.06)  # highest cell of bare ground
_BELOW_M = np.float32(0.15)  # a ray farther than this below the ground is a reflection


@dataclass(frozen=True, slots=True)
class View:
    """base_link at stamp_s, m.

    origin_m: x, y, z of the sensor. hits: (n, 3) tops of returns that are neither ground nor the robot. passed_m:
    (directions, bins) height above the ground of the lowest ray that passed the bin, inf where none did, NaN without
    coverage of the sensor; direction i is -pi + (i + 0.5) * 2 pi / directions, bin k from k * BIN_M on. ground_m:
    (directions, bins) height of the ground. specks: (n, 3) returns that may be too few for an object: they keep an
    existing one. bare: (directions, bins) ground returned from there, and nothing above it. floor:
    (k, 4) x, y, z of ground, base_link levelled, and its number of returns, 0 between two rings. tilt: by how much
    base_link's x and y axes rise. up: slope of the sensor's highest beam; inf where that does not matter. looked_s:
    (k,) when the sensor looked in each of k directions, relative to the stamp.
    """

    stamp_s: float
    origin_m: tuple[float, float, float]
    hits: Float
    passed_m: Float
    ground_m: Float
    bare: Mask
    specks: Float = field(default_factory=lambda: _NOTHING)
    floor: Float = field(default_factory=lambda: _NO_FLOOR)
    tilt: tuple[float, float] = (0.0, 0.0)
    up: float = math.inf
    looked_s: NDArray[np.float64] = field(default_factory=lambda: _AT_ONCE)

    def seen_at_s(self, pose: Pose2, x_m: float, y_m: float) -> float:
        """The time at which the sensor looked at a place in odom; base_link was at ``pose`` at the stamp."""
        place = Pose2(x_m, y_m, 0.0).relative_to(pose)
        x, y = place.x - self.origin_m[0], place.y - self.origin_m[1]
        return self.stamp_s + float(self.looked_s[direction_of(x, y, len(self.looked_s))])

    def within(self, range_m: float, reach_m: float) -> View:
        """Without returns farther than ``range_m`` from base_link and rays farther than ``reach_m`` from the sensor."""
        hits, specks = (rows[np.hypot(rows[:, 0], rows[:, 1]) <= range_m] for rows in (self.hits, self.specks))
        bins = math.ceil(reach_m / BIN_M)
        passed_m, ground_m = (np.ascontiguousarray(rows[:, :bins]) for rows in (self.passed_m, self.ground_m))
        bare = np.ascontiguousarray(self.bare[:, :bins])
        return replace(self, hits=hits, specks=specks, passed_m=passed_m, ground_m=ground_m, bare=bare)


def direction_of(x: Any, y: Any, directions: int) -> Any:
    """Index of the direction that holds the bearing of (x, y), numbers or arrays."""
    share = np.arctan2(y, x) / (2.0 * math.pi) + 0.5
    return np.minimum((share * directions).astype(np.int64), directions - 1)


def view_of_beams(
    stamp_s: float,
    origin_m: tuple[float, float, float],
    ends: Float,
    returned: NDArray[np.bool_],
    own: NDArray[np.bool_],
    reach_m: float,
    directions: int = 360,
) -> View:
    """The view of a sensor with few beams: a planar scanner, an array of ranges.

    ends: (n, 3) base_link, end of each beam: at its return, or, without a return, at the distance for which the
    sensor guarantees one; less than ``BIN_M`` away if it guarantees none. returned: (n,). own: (n,)
    returns of the robot or its chair: they hide, and are no obstacle. The ground is assumed level.
    """
    finite = np.isfinite(ends).all(axis=1)
    bins = math.ceil(reach_m / BIN_M)
    passed = np.full((directions, bins), np.nan, np.float32)
    _pass_beams(np.ascontiguousarray(ends[finite], np.float32), np.array(origin_m, np.float32), passed)
    hits = ends[finite & returned & ~own].astype(np.float32)
    hits[:, 2] += np.float32(RISE_M)
    shape = (directions, bins)
    return View(stamp_s, origin_m, hits, passed, np.zeros(shape, np.float32), np.zeros(shape, np.bool_))


class SweepViews:
    """Views of a spinning sensor, from the cells of its sorted points."""

    def __init__(
        self, grid: PolarGrid, reach_m: float, floor_m: float, spacing_rad: float, slope_deg: float, up: float
    ) -> None:
        """reach_m, floor_m: greatest distance of rays and of ground. spacing_rad: between its rings. slope_deg: of the
        steepest ramp. up: as in ``View``."""
        self._edges_m, self._spacing_rad, self._up = grid.edges_m, spacing_rad, up
        self._slope = math.tan(math.radians(slope_deg))
        self._bins, self._floor_m = math.ceil(reach_m / BIN_M), math.ceil(floor_m / BIN_M) * BIN_M
        # A ray has passed a bin if it returned from a ring that begins behind it.
        ends = (np.arange(self._bins) + 1) * BIN_M
        self._behind = np.searchsorted(grid.edges_m[:-1], ends - 1e-4).astype(np.int32)

    def view(
        self,
        stamp_s: float,
        origin_m: tuple[float, float, float],
        tilt: tuple[float, float],
        hits: Float,
        points: Sorted,
        profile: Profile,
    ) -> View:
        """origin_m: the sensor, levelled frame."""
        cells = points.cells
        directions = len(cells.values)
        passed = np.full((directions, self._bins), np.nan, np.float32)
        passed[_looked_at(profile.covered)] = np.inf
        ground = np.zeros((directions, self._bins), np.float32)
        bare = np.zeros((directions, self._bins), np.bool_)
        _pass_sweep(
            cells.values,
            cells.sectors,
            profile.kind,
            self._edges_m,
            self._behind,
            profile.drop_m,
            np.float32(origin_m[2]),
            passed,
            ground,
            bare,
        )
        floor = np.empty((_MOST_FLOOR, 4), np.float32)
        numbers = np.array([*origin_m, self._floor_m, self._spacing_rad, self._slope], np.float32)
        count = _floor(cells.values, cells.sectors, profile.kind, profile.drop_m, numbers, floor)
        return View(stamp_s, origin_m, hits, passed, ground, bare, floor=floor[:count], tilt=tilt, up=self._up)


def _looked_at(covered: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(directions,) covered ones and all between two of them, unless they are as far apart as a sensor's halves."""
    found = np.flatnonzero(covered)
    looked = covered.copy()
    widest = len(covered) // 8
    for begin, end in zip(found, np.append(found[1:], found[:1] + len(covered)), strict=True):
        if 1 < end - begin <= widest:
            looked[np.arange(begin, end) % len(covered)] = True
    return looked


@compiled(error_model="numpy")
def _pass_sweep(
    cells: Float,
    active: Any,
    kind: Any,
    edges: Float,
    behind: Any,
    drop_m: Float,
    sensor_m: Any,
    passed: Float,
    ground: Float,
    bare: Mask,
) -> None:
    rings, bins = cells.shape[1], passed.shape[1]
    lowest = np.empty(rings + 1, np.float32)  # slope of the lowest ray that returned from a ring or beyond it
    for s in active:
        if math.isnan(passed[s, 0]):
            continue
        lowest[rings] = np.inf
        for k in range(rings - 1, -1, -1):
            lowest[k] = lowest[k + 1]
            if cells[s, k, COUNT] > np.float32(0.0) and kind[s, k] != EMPTY and kind[s, k] != DROP:
                slope = (cells[s, k, HEIGHT] - sensor_m) / max(cells[s, k, DISTANCE], np.float32(0.1))
                lowest[k] = min(lowest[k], slope)
        height, k = np.float32(0.0), 0
        for b in range(bins):
            begin = np.float32(b * BIN_M)
            if np.float32(0.0) < drop_m[s] <= begin:
                break  # beyond here the ground is not connected with the wheels
            while k < rings and edges[k] <= begin:
                if cells[s, k, COUNT] > np.float32(0.0) and kind[s, k] != EMPTY:
                    height = cells[s, k, GROUND_M]
                k += 1
            ground[s, b] = height
            at = k - 1  # the ring that holds the bin
            if at >= 0 and kind[s, at] == FLOOR and cells[s, at, COUNT] > np.float32(0.0):
                bare[s, b] = cells[s, at, TOP] - cells[s, at, HEIGHT] < _FLAT_M
            slope = lowest[behind[b]]
            if slope == np.inf:
                continue
            above = sensor_m + slope * begin - height
            if above >= -_BELOW_M:
                passed[s, b] = max(above, np.float32(0.0))


@compiled(error_model="numpy")
def _floor(cells: Float, active: Any, kind: Any, drop_m: Float, p: Float, floor: Float) -> int:
    """Cells of bare ground, also of ground that has fallen away; and, with 0 returns, the places between
    two of them that one missing ring explains. Returns their number.

    p: x, y, z of the sensor, levelled, greatest distance, angle between rings, slope.
    """
    sectors, rings = kind.shape
    count, sensor, reach_m = 0, p[2], p[3]
    for s in active:
        angle = (s + 0.5) * 2.0 * math.pi / sectors - math.pi
        c, si = np.float32(math.cos(angle)), np.float32(math.sin(angle))
        last_m, last_z = np.float32(np.inf), np.float32(0.0)
        for k in range(rings):
            away = cells[s, k, DISTANCE]
            fallen = kind[s, k] == DROP and np.float32(0.0) < drop_m[s] <= away
            if cells[s, k, COUNT] == np.float32(0.0):
                continue
            if not (kind[s, k] == FLOOR or fallen) or away > reach_m or _beside_a_thing(cells, kind, s, k):
                last_m = np.float32(np.inf)
                continue
            if count == len(floor):
                return count
            z, gap = cells[s, k, HEIGHT], away - last_m
            ring_gap = (away * away + sensor * sensor) / sensor * p[4]
            level = abs(z - last_z) <= p[5] * gap + _FLAT_M
            between = int(gap / np.float32(BIN_M)) if level and gap <= _RINGS * ring_gap else 0
            for i in range(1, min(between + 1, len(floor) - count)):
                at = last_m + np.float32(i * BIN_M)
                floor[count, 0], floor[count, 1], floor[count, 2], floor[count, 3] = (
                    p[0] + at * c,
                    p[1] + at * si,
                    z,
                    0.0,
                )
                count += 1
            floor[count, 0], floor[count, 1] = p[0] + away * c, p[1] + away * si
            floor[count, 2], floor[count, 3] = z, cells[s, k, COUNT]
            count += 1
            last_m, last_z = away, z
    return count


@compiled(error_model="numpy")
def _beside_a_thing(cells: Float, kind: Any, s: int, k: int) -> bool:
    """True if an object stands in the cell or in one around it: low points there may be its foot."""
    sectors, rings = kind.shape
    for i in range(s - 1, s + 2):
        t = i % sectors
        for j in range(max(k - 1, 0), min(k + 2, rings)):
            if kind[t, j] == EMPTY:
                continue
            if kind[t, j] == STEP or kind[t, j] == TALL or cells[t, j, TOP] - cells[t, j, HEIGHT] >= _FLAT_M:
                return True
    return False


@compiled(error_model="numpy")
def _pass_beams(ends: Float, origin: Float, passed: Float) -> None:
    directions, bins = passed.shape
    for i in range(len(ends)):
        dx, dy = ends[i, 0] - origin[0], ends[i, 1] - origin[1]
        away = math.sqrt(dx * dx + dy * dy)
        slope = (ends[i, 2] - origin[2]) / max(away, 1e-3)
        s = min(int((math.atan2(dy, dx) + math.pi) / (2.0 * math.pi) * directions), directions - 1)
        if math.isnan(passed[s, 0]):
            passed[s] = np.inf
        for b in range(min(int(away / BIN_M), bins)):
            above = np.float32(max(origin[2] + slope * b * BIN_M, 0.0))
            passed[s, b] = min(passed[s, b], above)
