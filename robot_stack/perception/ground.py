"""Classification of ground points: a profile of each direction, followed outwards from the wheels.

Ground is what can be reached from the wheels without climbing or falling more steeply than a ramp. Every direction
keeps a cone of heights that this allows: it widens with the distance and narrows at each cell of ground found in it. A
cell above the cone is a step or an obstacle, whatever its height: so a kerb of 5 cm is detected where its cells are
short enough to make it steeper than a ramp. A cell below the cone is ground that falls away. Heights are along gravity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.core.range_sensor import RangeSensor
from robot_stack.core.robot import Robot
from robot_stack.perception.cells import DROP, EMPTY, FLOOR, GROUND, HIGH, KERB, LOW, OBSTACLE, STEP, TALL, UNKNOWN
from robot_stack.perception.params import FreeSpaceParams, GroundParams
from robot_stack.perception.polar import COUNT, DISTANCE, GROUND_M, HEIGHT, TOP, PolarGrid, Sorted
from robot_stack.perception.steps import RingErrors, look_again

Float = NDArray[np.float32]
Int = NDArray[np.int32]
Bytes = NDArray[np.uint8]
_SIDE_SECTORS = 30  # searched on each side: the attached chair hides 25 deg
_CROWN = 0.5  # of the steepest slope: how far ground hidden from both sides may rise above them
_IN_RANGE = 0.8  # of the ground that a sensor sees: there the second next ring is within its range too


@dataclass(frozen=True, slots=True)
class Profile:
    """kind: (sectors, rings) of the cells' kinds; covered: (sectors,) directions in which any cell holds points.

    free_m: (sectors,) distance from the sensor of ground observed without a gap or an obstacle, 0: none.
    drop_m: (sectors,) distance from the sensor to the edge of a drop-off, 0: none; drop_height_m: the ground before it.
    """

    kind: Bytes
    covered: NDArray[np.bool_]
    free_m: Float
    drop_m: Float
    drop_height_m: Float


@dataclass(frozen=True, slots=True)
class Reach:
    """Values from a sensor's mounting. first_ground_m: the first ring of ground must be nearer than this;
    ring_spacing_rad: between its rings; edge_m: beyond this a ramp down hides itself as a drop-off does, or the next
    rings of ground are out of range.

    range_bias_m, elevation_bias_rad: largest errors of two of its rings against each other.
    """

    first_ground_m: float
    ring_spacing_rad: float
    edge_m: float
    range_bias_m: float
    elevation_bias_rad: float


def reach_of(sensor: RangeSensor, params: GroundParams, free: FreeSpaceParams, range_m: float) -> Reach:
    """range_m: greatest range that is used."""
    height_m = sensor.xyz_m[2]
    in_range_m = _IN_RANGE * math.sqrt(max(range_m**2 - height_m**2, 0.0))
    edge_m = min(height_m / math.tan(math.radians(params.max_slope_deg)), in_range_m)
    first_m, tilt_rad = free.first_ground_factor * sensor.first_ground_m(), math.radians(sensor.elevation_bias_deg)
    return Reach(first_m, sensor.ring_spacing_rad, edge_m, 2.0 * sensor.range_bias_m, 2.0 * tilt_rad)


def wheel_border(robot: Robot, grid: PolarGrid, sensor_xy_m: tuple[float, float]) -> NDArray[np.float64]:
    """(sectors, 3) where each direction from the sensor leaves the quadrangle of the wheels, base_link, m.

    The wheels stand on the ground there.
    """
    angles = (np.arange(grid.sectors) + 0.5) * (2.0 * math.pi / grid.sectors) - math.pi
    x0, y0 = sensor_xy_m
    c, s = np.cos(angles), np.sin(angles)
    fl, fr, rl, rr = robot.module_positions_m()
    distance = np.full(grid.sectors, np.inf)
    for (x1, y1), (x2, y2) in ((fl, rl), (rl, rr), (rr, fr), (fr, fl)):
        outward = (y2 - y1) * c - (x2 - x1) * s
        with np.errstate(divide="ignore", invalid="ignore"):
            to_side = ((y2 - y1) * (x1 - x0) - (x2 - x1) * (y1 - y0)) / outward
        distance = np.where(outward > 0.0, np.minimum(distance, to_side), distance)
    distance = np.maximum(distance, 0.0)
    x, y = x0 + distance * c, y0 + distance * s
    return np.stack([x, y, np.zeros_like(x)], axis=1)


def seeds(border: NDArray[np.float64], level: NDArray[np.float64], origin: tuple[float, float]) -> tuple[Float, Float]:
    """(sectors,) distances from the sensor to ``wheel_border``, and the ground's height there, both levelled.

    level: (3, 3) base_link to levelled; origin: the sensor in the levelled frame.
    """
    turned = border @ level.T
    away = np.hypot(turned[:, 0] - origin[0], turned[:, 1] - origin[1])
    return away.astype(np.float32), turned[:, 2].astype(np.float32)


def follow(
    points: Sorted,
    grid: PolarGrid,
    start: tuple[Float, Float],
    sensor_height_m: float,
    params: GroundParams,
    free: FreeSpaceParams,
    reach: Reach,
) -> Profile:
    """The ground in every direction. sensor_height_m: in the levelled frame, above base_link's origin."""
    kind = np.zeros((grid.sectors, grid.rings), np.uint8)
    free_m, drop_m, drop_z = (np.zeros(grid.sectors, np.float32) for _ in range(3))
    numbers = np.array(
        [
            math.tan(math.radians(params.max_slope_deg)),
            params.range_sigma_m,
            params.step_tolerance_m,
            params.drop_tolerance_m,
            params.drop_min_m,
            params.drop_points_min,
            params.lateral_cone_m,
            params.wall_extent_m,
            params.wall_foot_m,
            params.kerb_height_m,
            reach.edge_m,
            reach.first_ground_m,
            reach.ring_spacing_rad,
            free.gap_factor,
            free.gap_m,
            sensor_height_m,
            reach.range_bias_m,
            reach.elevation_bias_rad,
        ],
        dtype=np.float32,
    )
    cells, covered = points.cells, np.zeros(grid.sectors, np.bool_)
    _follow(cells.values, cells.sectors, grid.edges_m, *start, numbers, kind, free_m, drop_m, drop_z, covered)
    errors = RingErrors(sensor_height_m, reach.range_bias_m, reach.elevation_bias_rad)
    look_again(cells, start, kind, free_m, reach.ring_spacing_rad, errors, params)
    return Profile(kind, covered, free_m, drop_m, drop_z)


def classify(
    points: Sorted, profile: Profile, sensor_height_m: float, params: GroundParams, reach: Reach
) -> tuple[Bytes, Float]:
    """(n,) the label of each point, and (n,) its height above the local ground, m."""
    labels, height = np.empty(len(points.cell), np.uint8), np.empty(len(points.cell), np.float32)
    numbers = np.array(
        [
            params.point_tolerance_m,
            3.0 * params.range_sigma_m + reach.range_bias_m,
            params.kerb_point_m,
            params.obstacle_min_m,
            params.obstacle_max_m,
            sensor_height_m,
            math.tan(math.radians(params.max_slope_deg)),
        ],
        dtype=np.float32,
    )
    values = points.cells.values
    cells = values.reshape(-1, values.shape[2])
    _classify(points.cell, points.height_m, points.distance_m, cells, profile.kind.ravel(), numbers, labels, height)
    return labels, height


@compiled(error_model="numpy")
def _follow(
    cells: Float,
    active: Int,
    edges: Float,
    seed_d: Float,
    seed_z: Float,
    p: Float,
    kind: Bytes,
    free: Float,
    drop: Float,
    drop_z: Float,
    covered: Any,
) -> None:
    sectors, rings = cells.shape[0], cells.shape[1]
    slope, sigma, step_tolerance, drop_tolerance, drop_min, drop_points = p[0], p[1], p[2], p[3], p[4], p[5]
    lateral, extent, foot, kerb_height, edge_range = p[6], p[7], p[8], p[9], p[10]
    first_ground, spacing, gap_factor, gap, sensor, bias, tilt = p[11], p[12], p[13], p[14], p[15], p[16], p[17]
    zero = np.float32(0.0)
    upper, lower = seed_z.copy(), seed_z.copy()  # the cone, at the radius ``at``
    firm = seed_z.copy()  # like lower, from cells with enough points: single points may be airborne
    at = seed_d.copy()
    last_z, last_d = seed_z.copy(), seed_d.copy()  # the last ground
    seen = np.zeros(sectors, np.bool_)  # ground beyond the seed
    open_way = np.ones(sectors, np.bool_)
    fallen = np.zeros(sectors, np.int32)  # points below the cone, not confirmed yet
    fallen_z, fallen_d = np.zeros(sectors, np.float32), np.zeros(sectors, np.float32)
    anything = np.zeros(sectors, np.bool_)  # any point beyond the last ground
    for k in range(rings):
        inner, outer = edges[k], edges[k + 1]
        middle = np.float32(0.5) * (inner + outer)
        width = middle * np.float32(2.0 * math.pi / sectors)
        for s in active:
            if outer <= seed_d[s]:
                continue
            grown = slope * max(middle - at[s], zero)
            upper[s] += grown
            lower[s] -= grown
            firm[s] -= grown
            at[s] = max(at[s], middle)
            n = cells[s, k, COUNT]
            if n == zero:
                continue
            cells[s, k, GROUND_M] = last_z[s]
            anything[s] = True
            if upper[s] - lower[s] > lateral:
                if seen[s]:
                    _ask_neighbours(s, sectors, upper, lower, firm, at, seed_d, slope * width)
                else:
                    _ask_both_sides(s, sectors, upper, lower, firm, seen, np.float32(_CROWN) * slope * width)
            z, d = cells[s, k, HEIGHT], cells[s, k, DISTANCE]
            # Range errors at the angle of incidence: along the ray, so only a small part is height. A slope adds its
            # own share. Noise averages out over a cell's points; the bias of a ring does not.
            incline = abs(sensor - z) / max(d, np.float32(0.5)) + abs(z - seed_z[s]) / max(
                d - seed_d[s], np.float32(0.5)
            )
            noise = (np.float32(3.0) * sigma / math.sqrt(n) + bias) * min(incline, np.float32(1.0)) + tilt * d
            past = slope * (d - middle)
            above = z - (upper[s] + past)
            below = (firm[s] - past) - z
            wide = upper[s] - lower[s] > np.float32(0.5) * lateral
            wall = cells[s, k, TOP] - z > extent and wide and z - last_z[s] > foot
            if above > step_tolerance + noise or wall:
                kind[s, k] = STEP if z - last_z[s] <= kerb_height and not wall else TALL
                open_way[s] = False
                continue
            if below > drop_tolerance + noise:
                # The first cell below is a candidate; a second one beside it confirms the drop.
                kind[s, k] = DROP
                if fallen[s] == 0 or abs(z - fallen_z[s]) > slope * (d - fallen_d[s]) + np.float32(0.1):
                    if fallen[s] == 0:
                        fallen_d[s] = d
                    fallen_z[s] = z
                fallen[s] += np.int32(n)
                cells[s, k, GROUND_M] = z
                if fallen[s] >= drop_points and last_z[s] - z >= drop_min:
                    if drop[s] == zero and open_way[s] and last_d[s] < edge_range:
                        drop[s] = _edge(last_d[s], last_z[s], d, z, sensor, seen[s])
                        drop_z[s] = last_z[s]
                    open_way[s] = False
                    upper[s], lower[s], firm[s], last_z[s], last_d[s] = z, z, z, z, d
                    fallen[s] = 0
                continue
            kind[s, k] = FLOOR
            cells[s, k, GROUND_M] = z
            upper[s] = min(upper[s], z)
            lower[s] = min(max(lower[s], z), upper[s])
            firm[s] = min(max(firm[s], z), upper[s]) if n >= drop_points else min(firm[s], upper[s])
            if open_way[s]:
                ring_gap = (last_d[s] * last_d[s] + sensor * sensor) / sensor * spacing
                limit = gap + gap_factor * ring_gap if seen[s] else first_ground
                if d - last_d[s] <= limit:
                    free[s] = d
                else:
                    open_way[s] = False
            last_z[s], last_d[s] = z, d
            seen[s] = True
            fallen[s] = 0
            anything[s] = False
    # Ground that ends near the robot with nothing at all behind it: no sensor loses all of that. A single sector at the
    # border of a half sweep does not count: rotated back to the stamp, its last column lies in two sectors.
    ended = seen & ~anything & open_way & (last_d < edge_range)
    for s in active:
        if ended[s] and (ended[s - 1] or ended[(s + 1) % sectors]):
            drop[s], drop_z[s] = last_d[s], last_z[s]
        for k in range(rings):
            if kind[s, k] != EMPTY:
                covered[s] = True
                break


@compiled(error_model="numpy")
def _ask_neighbours(
    s: int, sectors: int, upper: Float, lower: Float, firm: Float, at: Float, seed_d: Float, rise: Any
) -> None:
    """In a sector without recent ground, the neighbours' ground narrows the cone."""
    for step in (-1, 1):
        other = (s + step) % sectors
        if at[other] <= seed_d[other]:
            continue
        if upper[other] - lower[other] > np.float32(0.5) * (upper[s] - lower[s]):
            continue
        _narrow(s, upper, lower, firm, upper[other] + rise, lower[other] - rise, firm[other] - rise)


@compiled(error_model="numpy")
def _ask_both_sides(s: int, sectors: int, upper: Float, lower: Float, firm: Float, seen: Any, rise: Any) -> None:
    """In a sector whose first surface is seen, the nearest ground on both sides bounds the cone.

    The attached chair hides the ground before it. Without this bound, the top of a low object there is within the cone.
    One side alone is no bound: a ramp is higher than the ground beside it.
    """
    high, deep, base = lower[s], upper[s], upper[s]
    for side in (-1, 1):
        for step in range(1, _SIDE_SECTORS + 1):
            other = (s + side * step) % sectors
            if seen[other] and upper[other] - lower[other] <= np.float32(0.5) * (upper[s] - lower[s]):
                high = max(high, upper[other] + step * rise)
                deep, base = min(deep, lower[other] - step * rise), min(base, firm[other] - step * rise)
                break
        else:
            return
    _narrow(s, upper, lower, firm, high, deep, base)


@compiled(error_model="numpy")
def _narrow(s: int, upper: Float, lower: Float, firm: Float, high: Any, deep: Any, base: Any) -> None:
    """Narrows a cone to bounds of its upper, lower and firm height, unless these contradict it."""
    if deep <= upper[s] and high >= lower[s]:
        upper[s], lower[s] = min(upper[s], high), max(lower[s], deep)
        firm[s] = min(max(firm[s], base), upper[s])


@compiled(error_model="numpy")
def _edge(last_d: Any, last_z: Any, d: Any, z: Any, sensor: Any, seen: bool) -> Any:
    """Edge between the last ground and the first point below: the ray to that point passed over the edge.

    At the latest where the ray crosses the ground's level; if ground was seen just before, there.
    """
    latest = d * (sensor - last_z) / max(sensor - z, np.float32(1e-3))
    if latest <= last_d:
        return last_d
    if seen:
        return last_d + min(latest - last_d, np.float32(0.05))
    return latest


@compiled(error_model="numpy")
def _classify(
    cell: Int, z: Float, distance: Float, cells: Float, kind: Bytes, p: Float, labels: Bytes, height: Float
) -> None:
    tolerance, three_sigma, kerb_min, low, high, sensor, slope = p[0], p[1], p[2], p[3], p[4], p[5], p[6]
    for i in range(len(cell)):
        if cell[i] < 0:
            labels[i], height[i] = UNKNOWN, np.float32(0.0)
            continue
        c = np.uint32(cell[i])
        ground = cells[c, GROUND_M]
        h = z[i] - ground
        height[i] = h
        what = kind[c]
        if what == FLOOR or what == DROP:
            limit = tolerance + three_sigma * min(
                abs(sensor - ground) / max(distance[i], np.float32(0.5)), np.float32(1.0)
            )
            limit += np.float32(0.8) * slope * abs(distance[i] - cells[c, DISTANCE])
            if h <= limit:
                labels[i] = GROUND
                continue
        if h > high:
            labels[i] = HIGH
        elif h >= low:
            labels[i] = OBSTACLE
        elif what == STEP and h >= kerb_min:
            labels[i] = KERB
        else:
            labels[i] = LOW
