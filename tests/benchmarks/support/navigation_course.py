"""Courses of the benchmark ``navigation``: walls, boxes, gates and people from a seed, and a simulated sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from robot_stack.core.compiled import compiled
from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import Footprint
from robot_stack.core.site_map import FREE, OCCUPIED, Grid

Array = npt.NDArray[np.float64]
MAP_RESOLUTION_M, COSTMAP_M, COSTMAP_RESOLUTION_M = 0.1, 10.0, 0.05
LENGTH_M, WIDTH_M = 32.0, 16.0
PERSON_RADIUS_M = 0.25
_GATE_M = 1.3
_RAYS, _RANGE_M = 720, 8.0
_LIDAR_X_M = 0.2


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle in map: middle, half sizes, yaw."""

    x: float
    y: float
    half_x: float
    half_y: float
    yaw: float

    def distance(self, points: Array) -> Array:
        """(n,) from the rectangle to (n, 2) points, negative inside."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        dx, dy = points[:, 0] - self.x, points[:, 1] - self.y
        ax = np.abs(c * dx + s * dy) - self.half_x
        ay = np.abs(-s * dx + c * dy) - self.half_y
        outside = np.hypot(np.maximum(ax, 0.0), np.maximum(ay, 0.0))
        return np.asarray(outside + np.minimum(np.maximum(ax, ay), 0.0))


@dataclass
class Walker:
    """Walks to and fro between two points. Stops if a robot is right ahead, as people do, and pauses at the ends."""

    a: tuple[float, float]
    b: tuple[float, float]
    speed_mps: float
    x: float = 0.0
    y: float = 0.0
    pause_s: float = 0.0
    towards_b: bool = True

    def __post_init__(self) -> None:
        self.x, self.y = self.a

    def step(self, dt_s: float, robot: Pose2, footprint: Footprint, random: np.random.Generator) -> None:
        if self.pause_s > 0.0:
            self.pause_s -= dt_s
            return
        tx, ty = self.b if self.towards_b else self.a
        far = math.hypot(tx - self.x, ty - self.y)
        if far < 0.1:
            self.towards_b, self.pause_s = not self.towards_b, float(random.uniform(0.5, 3.0))
            return
        ux, uy = (tx - self.x) / far, (ty - self.y) / far
        ahead = np.array([(self.x + 0.5 * ux, self.y + 0.5 * uy)])
        here = np.array([(self.x, self.y)])
        box = body(robot, footprint)
        gap, next_gap = float(box.distance(here)[0]), float(box.distance(ahead)[0])
        if next_gap < 0.6 and next_gap < gap:
            return
        self.x, self.y = self.x + ux * self.speed_mps * dt_s, self.y + uy * self.speed_mps * dt_s


def body(pose: Pose2, footprint: Footprint) -> Box:
    middle, half = 0.5 * (footprint.front_m + footprint.rear_m), 0.5 * (footprint.front_m - footprint.rear_m)
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    return Box(pose.x + c * middle, pose.y + s * middle, half, 0.5 * footprint.width_m, pose.yaw)


@dataclass
class Course:
    """known: boxes in the map. unknown: boxes not in the map. start, goal: poses in map."""

    start: Pose2
    goal: Pose2
    known: list[Box]
    unknown: list[Box] = field(default_factory=list)
    walkers: list[Walker] = field(default_factory=list)

    @property
    def boxes(self) -> list[Box]:
        return self.known + self.unknown

    def grid(self) -> Grid:
        shape = round(WIDTH_M / MAP_RESOLUTION_M), round(LENGTH_M / MAP_RESOLUTION_M)
        occupied = raster(self.known, shape, 0.0, 0.0, MAP_RESOLUTION_M)
        return Grid(MAP_RESOLUTION_M, 0.0, 0.0, np.where(occupied, OCCUPIED, FREE).astype(np.int8))

    def clearance_m(self, pose: Pose2, footprint: Footprint) -> tuple[float, float]:
        """True least distance from the footprint to (static boxes, walkers)."""
        edge = _edge(pose, footprint)
        still = min((float(box.distance(edge).min()) for box in self.boxes), default=9.0)
        # A corner of a box against the robot's side needs the distance measured from the box.
        robot = body(pose, footprint)
        for box in self.boxes:
            still = min(still, float(robot.distance(_corners(box)).min()))
        people = np.array([(one.x, one.y) for one in self.walkers]).reshape(-1, 2)
        walking = float(robot.distance(people).min()) - PERSON_RADIUS_M if len(people) else 9.0
        return still, walking


def _edge(pose: Pose2, footprint: Footprint) -> Array:
    half = 0.5 * footprint.width_m
    xs, ys = np.linspace(footprint.rear_m, footprint.front_m, 25), np.linspace(-half, half, 11)
    points = np.concatenate(
        [np.column_stack((xs, np.full(25, side))) for side in (-half, half)]
        + [np.column_stack((np.full(11, end), ys)) for end in (footprint.rear_m, footprint.front_m)]
    )
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    return np.column_stack((pose.x + c * points[:, 0] - s * points[:, 1], pose.y + s * points[:, 0] + c * points[:, 1]))


def _corners(box: Box) -> Array:
    c, s = math.cos(box.yaw), math.sin(box.yaw)
    signs = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)]) * (box.half_x, box.half_y)
    return np.column_stack((box.x + c * signs[:, 0] - s * signs[:, 1], box.y + s * signs[:, 0] + c * signs[:, 1]))


def raster(
    boxes: list[Box], shape: tuple[int, int], x0: float, y0: float, resolution_m: float
) -> npt.NDArray[np.bool_]:
    """(rows, columns) True for cells whose centre lies within half a cell of a box."""
    ys, xs = np.mgrid[0 : shape[0], 0 : shape[1]]
    points = np.column_stack((x0 + (xs.ravel() + 0.5) * resolution_m, y0 + (ys.ravel() + 0.5) * resolution_m))
    inside = np.zeros(len(points), np.bool_)
    for box in boxes:
        inside |= box.distance(points) <= 0.5 * resolution_m
    return inside.reshape(shape)


def course(seed: int, footprint: Footprint) -> Course:
    """One course: outer walls, two or three cross walls with a gate, boxes (half of them not in the map), people."""
    random = np.random.default_rng(seed)
    start = Pose2(2.5, float(random.uniform(4.0, 12.0)), 0.0)
    goal = Pose2(29.0, float(random.uniform(4.0, 12.0)), float(random.choice([0.0, 0.0, 1.2, -1.2])))
    known = [
        Box(LENGTH_M / 2, 0.1, LENGTH_M / 2, 0.1, 0.0),
        Box(LENGTH_M / 2, WIDTH_M - 0.1, LENGTH_M / 2, 0.1, 0.0),
        Box(0.1, WIDTH_M / 2, 0.1, WIDTH_M / 2, 0.0),
        Box(LENGTH_M - 0.1, WIDTH_M / 2, 0.1, WIDTH_M / 2, 0.0),
    ]
    crossings = [10.0, 21.0]
    for x in crossings:
        gate, width = (
            float(random.uniform(3.0, 13.0)),
            _GATE_M if random.random() < 0.6 else float(random.uniform(1.6, 3.0)),
        )
        low, high = gate - width / 2, gate + width / 2
        known += [Box(x, low / 2, 0.1, low / 2, 0.0), Box(x, (high + WIDTH_M) / 2, 0.1, (WIDTH_M - high) / 2, 0.0)]
    unknown: list[Box] = []
    for _ in range(40):
        if len(known) + len(unknown) >= 8 + 7:
            break
        half_x, half_y = (float(half) for half in random.uniform(0.3, 0.9, 2))
        x, y, yaw = (float(random.uniform(low, high)) for low, high in ((4, 28), (1.5, 14.5), (0, 3.1)))
        box = Box(x, y, half_x, half_y, yaw)
        reach = math.hypot(half_x, half_y)
        if any(abs(box.x - x) < reach + 2.2 for x in crossings):
            continue
        if any(math.hypot(box.x - pose.x, box.y - pose.y) < reach + 1.8 for pose in (start, goal)):
            continue
        # Two boxes either overlap or leave room for the chair between them.
        if any(
            math.hypot(box.x - other.x, box.y - other.y) < reach + math.hypot(other.half_x, other.half_y) + 1.5
            for other in (known[8:] + unknown)
        ):
            continue
        (known if random.random() < 0.5 else unknown).append(box)
    made = Course(start, goal, known, unknown)
    while len(made.walkers) < 3:
        x, y = float(random.uniform(5, 27)), float(random.uniform(2, 14))
        angle, length = float(random.uniform(0, 2 * math.pi)), float(random.uniform(3, 8))
        bx, by = x + length * math.cos(angle), y + length * math.sin(angle)
        line = np.column_stack((np.linspace(x, bx, 30), np.linspace(y, by, 30)))
        inside = (1.0 < bx < LENGTH_M - 1.0) and (1.0 < by < WIDTH_M - 1.0)
        free = inside and all(float(box.distance(line).min()) > 0.5 for box in made.boxes)
        away = min(math.hypot(x - start.x, y - start.y), math.hypot(bx - start.x, by - start.y)) > 2.5
        # No walker's line passes near the goal: a person standing on it would block it.
        if free and away and float(np.hypot(line[:, 0] - goal.x, line[:, 1] - goal.y).min()) > 2.0:
            made.walkers.append(Walker((x, y), (bx, by), float(random.uniform(0.6, 1.4))))
    return made


@compiled
def _seen(occupied: npt.NDArray[np.bool_], row: float, column: float, rays: int, reach: float) -> npt.NDArray[np.int8]:
    """(rows, columns): -1 unseen, 0 free, 100 first hit of a ray cast from a point given in cells."""
    out = np.full(occupied.shape, np.int8(-1))
    for k in range(rays):
        dx, dy = math.cos(2 * math.pi * k / rays), math.sin(2 * math.pi * k / rays)
        distance = 0.0
        while distance < reach:
            r, c = math.floor(row + distance * dy), math.floor(column + distance * dx)
            if r < 0 or c < 0 or r >= occupied.shape[0] or c >= occupied.shape[1]:
                break
            if occupied[r, c]:
                out[r, c] = 100
                break
            if out[r, c] != 100:
                out[r, c] = 0
            distance += 0.5
    return out


class Sensor:
    """A costmap around the robot in odom from line-of-sight rays; static obstacles remain marked once seen."""

    def __init__(self, made: Course, random: np.random.Generator) -> None:
        self._course, self._random = made, random
        shape = round(WIDTH_M / COSTMAP_RESOLUTION_M), round(LENGTH_M / COSTMAP_RESOLUTION_M)
        self._still = raster(made.boxes, shape, 0.0, 0.0, COSTMAP_RESOLUTION_M)
        self._memory = np.full(shape, -1, np.int8)

    def occupied(self) -> npt.NDArray[np.bool_]:
        """Boxes and walkers from the map's corner on, in cells of the costmap."""
        occupied, r = self._still.copy(), COSTMAP_RESOLUTION_M
        for one in self._course.walkers:
            _disc(occupied, one.x / r, one.y / r, PERSON_RADIUS_M / r)
        return occupied

    def costmap(self, pose: Pose2) -> tuple[Pose2, npt.NDArray[np.int8]]:
        """(origin, cells). Here the odom frame equals the map frame."""
        r, n = COSTMAP_RESOLUTION_M, round(COSTMAP_M / COSTMAP_RESOLUTION_M)
        occupied = self._still.copy()
        for one in self._course.walkers:
            jitter = self._random.normal(0.0, 0.02, 2)
            _disc(occupied, (one.x + jitter[0]) / r, (one.y + jitter[1]) / r, PERSON_RADIUS_M / r)
        lidar = pose.compose(Pose2(_LIDAR_X_M, 0.0, 0.0))
        seen = _seen(occupied, lidar.y / r, lidar.x / r, _RAYS, _RANGE_M / r)
        # Walkers are marked only while visible, as in a costmap whose marks decay.
        walks = (seen == OCCUPIED) & ~self._still
        self._memory = np.where((seen >= 0) & ~walks, seen, self._memory)
        shown = np.where(walks, seen, self._memory)
        row, column = math.floor(pose.y / r) - n // 2, math.floor(pose.x / r) - n // 2
        cells = np.full((n, n), -1, np.int8)
        r0, c0 = max(row, 0), max(column, 0)
        r1, c1 = min(row + n, occupied.shape[0]), min(column + n, occupied.shape[1])
        cells[r0 - row : r1 - row, c0 - column : c1 - column] = shown[r0:r1, c0:c1]
        return Pose2(column * r, row * r, 0.0), cells


def _disc(occupied: npt.NDArray[np.bool_], column: float, row: float, radius: float) -> None:
    reach = math.ceil(radius) + 1
    r0, c0 = max(0, math.floor(row) - reach), max(0, math.floor(column) - reach)
    window = occupied[r0 : math.floor(row) + reach, c0 : math.floor(column) + reach]
    ys, xs = np.mgrid[0 : window.shape[0], 0 : window.shape[1]]
    window |= np.hypot(xs + c0 + 0.5 - column, ys + r0 + 0.5 - row) <= radius
