"""Bodies that get into the robot's way: what the LiDARs see of them, contacts with the robot, and motion.

A walker does not react to the robot on its way; it stops only at contact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import Pose2, Twist2, exp_se2
from robot_stack.safety.collision import Outline
from sim.lidar import labels
from sim.lidar.bodies import person_shapes
from sim.lidar.shapes import BOX, CYLINDER, Shape

Floats = NDArray[np.float64]
Kind = Literal["child", "adult", "pole", "cart", "runner", "cyclist"]
KINDS: tuple[Kind, ...] = ("child", "adult", "pole", "cart")
FAST: tuple[Kind, ...] = ("runner", "cyclist")
SPEEDS_MPS = {
    "child": (0.6, 2.0),
    "adult": (0.6, 1.7),
    "pole": (0.3, 1.2),
    "cart": (0.4, 1.4),
    "runner": (4.0, 6.0),
    "cyclist": (4.0, 7.0),
}
_EDGE_STEP_M = 0.02
# Within this distance of the target, or this time, a walker's heading is fixed.
_LAST_STEPS_M, _LAST_STEPS_S = 1.2, 0.6
_LIGHT = 0.4


@dataclass(frozen=True, slots=True)
class Body:
    """shapes: in its own frame, x ahead. discs: (n, 3) x, y, radius, m, that cover its outline in plan."""

    kind: Kind
    shapes: tuple[Shape, ...]
    discs: Floats

    @property
    def radius_m(self) -> float:
        """Radius of the smallest circle around the body's origin that contains it."""
        return float((np.hypot(self.discs[:, 0], self.discs[:, 1]) + self.discs[:, 2]).max())

    def placed(self, pose: Pose2) -> Floats:
        """(n, 3) discs of the body at ``pose``."""
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        x, y, radius = self.discs.T
        return np.column_stack([pose.x + c * x - s * y, pose.y + s * x + c * y, radius])

    def outline(self, pose: Pose2) -> Floats:
        """(m, 2) points on the outline of the body at ``pose``."""
        discs, around = self.placed(pose), np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)
        ring = np.column_stack([np.cos(around), np.sin(around)])
        points: Floats = (discs[:, None, :2] + discs[:, None, 2:] * ring).reshape(-1, 2)
        return points


def drawn_body(kind: Kind, random: np.random.Generator) -> Body:
    """A random body of the kind: from toddler to schoolchild, from a pole on wheels to a low trolley."""
    match kind:
        case "child":
            top_m = random.uniform(0.62, 1.20)
            return _of_posts(kind, [(0.0, 0.0, 0.10 * top_m + random.uniform(0.0, 0.03), top_m)])
        case "adult" | "runner":
            return _of_cylinders(kind, tuple(person_shapes(_LIGHT)))
        case "pole":
            return _of_posts(kind, [(0.0, 0.0, random.uniform(0.02, 0.03), random.uniform(1.2, 1.9))])
        case "cart":
            top_m = random.choice([0.25, 0.5, 0.9])
            half = (0.5 * random.uniform(0.5, 0.9), 0.5 * random.uniform(0.4, 0.6), 0.5 * (top_m - 0.05))
            box = Shape(BOX, (0.0, 0.0, 0.05 + half[2]), half, labels.PERSON, _LIGHT)
            return Body(kind, (box,), _edge(half[0], half[1]))
        case "cyclist":
            return _cyclist(random.uniform(1.5, 1.8))


def _cyclist(top_m: float) -> Body:
    """Two wheels, a frame, a handlebar and a rider."""
    boxes = [(x, (0.34, 0.03, 0.34), 0.34) for x in (-0.53, 0.53)]
    boxes += [(0.0, (0.45, 0.03, 0.15), 0.55), (0.45, (0.03, 0.30, 0.03), 1.0)]
    shapes = [Shape(BOX, (x, 0.0, z), half, labels.PERSON, _LIGHT) for x, half, z in boxes]
    middle_m, half_m = 0.5 * (top_m + 0.4), 0.5 * (top_m - 0.4)
    shapes.append(Shape(CYLINDER, (-0.1, 0.0, middle_m), (0.22, 0.22, half_m), labels.PERSON, _LIGHT))
    edges = [_edge(half[0], half[1]) + np.array([x, 0.0, 0.0]) for x, half, _ in boxes]
    return Body("cyclist", tuple(shapes), np.concatenate([*edges, [(-0.1, 0.0, 0.22)]]))


def _of_posts(kind: Kind, posts: list[tuple[float, float, float, float]]) -> Body:
    """posts: x, y, radius, top."""
    shapes = [Shape(CYLINDER, (x, y, 0.5 * h), (r, r, 0.5 * h), labels.PERSON, _LIGHT) for x, y, r, h in posts]
    return _of_cylinders(kind, tuple(shapes))


def _of_cylinders(kind: Kind, shapes: tuple[Shape, ...]) -> Body:
    discs = [(shape.centre_m[0], shape.centre_m[1], shape.half_m[0]) for shape in shapes]
    return Body(kind, shapes, np.array(discs))


def _edge(half_x: float, half_y: float) -> Floats:
    """Discs of zero radius along the edge of a rectangle."""
    x = np.arange(-half_x, half_x + _EDGE_STEP_M, _EDGE_STEP_M).clip(max=half_x)
    y = np.arange(-half_y, half_y + _EDGE_STEP_M, _EDGE_STEP_M).clip(max=half_y)
    sides = [(x, np.full_like(x, side)) for side in (-half_y, half_y)]
    sides += [(np.full_like(y, side), y) for side in (-half_x, half_x)]
    return np.concatenate([np.column_stack([u, v, np.zeros_like(u)]) for u, v in sides])


@dataclass(frozen=True, slots=True)
class Contact:
    """gap_m: from the body to the outline, negative inside it. x, y: nearest point of the outline, base_link, m.

    towards: unit vector from there to the body.
    """

    gap_m: float
    x: float
    y: float
    towards: tuple[float, float]

    def speed_mps(self, twist: Twist2) -> float:
        """Speed of the outline at this point."""
        return math.hypot(twist.vx - twist.omega * self.y, twist.vy + twist.omega * self.x)

    def closing_mps(self, twist: Twist2) -> float:
        """Speed of the outline towards the body; negative: away from it."""
        vx, vy = twist.vx - twist.omega * self.y, twist.vy + twist.omega * self.x
        return vx * self.towards[0] + vy * self.towards[1]


def contact(body: Body, seen_from_robot: Pose2, outline: Outline) -> Contact:
    """The gap between the outline and a body at a pose in base_link."""
    discs = body.placed(seen_from_robot)
    nearest = int(np.argmin(outline.distances(discs) - discs[:, 2]))
    cx, cy, radius = (float(value) for value in discs[nearest])
    x, y = min(max(cx, outline.rear), outline.front), min(max(cy, -outline.half), outline.half)
    dx, dy = cx - x, cy - y
    away = math.hypot(dx, dy)
    if away > 0.0:
        return Contact(away - radius, x, y, (dx / away, dy / away))
    depth, normal = max(
        (cx - outline.front, (1.0, 0.0)),
        (outline.rear - cx, (-1.0, 0.0)),
        (cy - outline.half, (0.0, 1.0)),
        (-outline.half - cy, (0.0, -1.0)),
    )
    return Contact(depth - radius, x, y, normal)


@dataclass(slots=True)
class Walker:
    """Walks to a place beside the moving robot, and stays there or goes straight on.

    pose: in map, facing the way. target: the place in base_link. through: goes straight on. For the last 1.2 m
    and the last 0.6 s the heading is fixed.
    """

    pose: Pose2
    target: tuple[float, float]
    speed_mps: float
    through: bool
    remaining_m: float | None = None

    @property
    def arrived(self) -> bool:
        """True if the walker stands at its target."""
        return not self.through and self.remaining_m is not None and self.remaining_m <= 0.0

    def step(self, dt_s: float, robot: Pose2, twist: Twist2) -> None:
        """twist: of the robot, base_link."""
        if self.remaining_m is None:
            self._aim(robot, twist)
        ahead_m = self.speed_mps * dt_s
        if self.arrived:
            return
        if self.remaining_m is not None:
            self.remaining_m -= ahead_m
        self.pose = self.pose.compose(Pose2(ahead_m, 0.0, 0.0))

    def _aim(self, robot: Pose2, twist: Twist2) -> None:
        remaining_m, heading = self._to_target(robot)
        for _ in range(3):  # to the predicted target position on arrival
            remaining_m, heading = self._to_target(robot.compose(exp_se2(twist, remaining_m / self.speed_mps)))
        self.pose = Pose2(self.pose.x, self.pose.y, heading)
        if remaining_m <= max(_LAST_STEPS_M, self.speed_mps * _LAST_STEPS_S):
            self.remaining_m = remaining_m

    def _to_target(self, robot: Pose2) -> tuple[float, float]:
        """(m, rad) to the target beside a robot at that pose."""
        place = robot.compose(Pose2(*self.target, 0.0))
        dx, dy = place.x - self.pose.x, place.y - self.pose.y
        return math.hypot(dx, dy), math.atan2(dy, dx)
