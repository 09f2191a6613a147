"""Collision check: the footprint moved along the arc of a constant twist against obstacle points.

All motion is relative to the robot: while it drives with a constant twist, a point that is fixed in the world moves
past it on a circle around the instantaneous centre of rotation (on a straight line without a turn). The moment at
which that path first crosses the outline is the exact time to collision, without steps; the distance that the point
travels until then, relative to the robot, is the clearance ahead of the motion. A point beside the way is never
touched, however near.

A point that is inside the outline already, because it is within the margin, counts as touched if the motion brings it
deeper, and as soon as the body itself touches it: a robot beside a wall may leave it, and drive along it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import Twist2
from robot_stack.core.robot import Footprint

Floats = NDArray[np.float64]

# A turn with a larger radius than this, m, is a straight line: over 5 m they differ by 12 mm.
_STRAIGHT_RADIUS_M = 1000.0
# Replaces a speed of zero as a divisor, m/s.
_TINY = 1e-9
# A point inside the outline gets deeper if more than this share of its motion leads inwards: sine of 10 deg.
_INWARDS = 0.17


@dataclass(frozen=True, slots=True)
class Outline:
    """A rectangle in base_link, m: x from rear to front, y +-half. margin: its excess over the body on each side."""

    front: float
    rear: float
    half: float
    margin: float = 0.0

    def body(self) -> Outline:
        """The outline without the margin."""
        m = self.margin
        return Outline(self.front - m, self.rear + m, self.half - m)

    def contains(self, points: Floats) -> NDArray[np.bool_]:
        """(n,) which of the (n, 2+) points lie within it, the edge included."""
        x, y = points[:, 0], points[:, 1]
        return (x <= self.front) & (x >= self.rear) & (np.abs(y) <= self.half)

    def distances(self, points: Floats) -> Floats:
        """(n,) m from the (n, 2+) points to it, 0 inside."""
        x, y = points[:, 0], points[:, 1]
        ahead = np.maximum(np.maximum(x - self.front, self.rear - x), 0.0)
        return np.hypot(ahead, np.maximum(np.abs(y) - self.half, 0.0))

    def reach(self) -> float:
        """Distance of the farthest corner from base_link, m."""
        return math.hypot(max(self.front, -self.rear), self.half)


def outline_of(footprint: Footprint, margin_m: float = 0.0) -> Outline:
    """The footprint, widened all around by ``margin_m``."""
    half = 0.5 * footprint.width_m
    return Outline(footprint.front_m + margin_m, footprint.rear_m - margin_m, half + margin_m, margin_m)


@dataclass(frozen=True, slots=True)
class Approach:
    """Approach of a motion to obstacles. Both infinite if it never touches one.

    time_s: until the first touch of the widened outline at this speed. clearance_m: the shortest remaining way of a
    point to its contact, relative to the robot, the margin included: it depends on the direction of the motion alone.
    """

    time_s: float = math.inf
    clearance_m: float = math.inf

    def worse(self, other: Approach) -> Approach:
        """The smaller of each."""
        return Approach(min(self.time_s, other.time_s), min(self.clearance_m, other.clearance_m))


FREE = Approach()


def approach(points: Floats, outline: Outline, twist: Twist2) -> Approach:
    """Approach of the robot by ``twist`` (finite, not zero) to (n, 2+) finite points in base_link, m."""
    if len(points) == 0:
        return FREE
    times = contact_times(points, outline, twist)
    touched = np.isfinite(times)
    if not touched.any():
        return FREE
    times, met = times[touched], points[touched]
    speeds = np.hypot(twist.vx - twist.omega * met[:, 1], twist.vy + twist.omega * met[:, 0])
    margins = np.where(outline.contains(met) & (times > 0.0), 0.0, outline.margin)  # their times are to the body itself
    return Approach(float(times.min()), float((times * speeds + margins).min()))


def contact_times(points: Floats, outline: Outline, twist: Twist2) -> Floats:
    """(n,) s until each point is touched, inf if never; 0 for points inside that get deeper, and for those that do not
    the time until the body without its margin touches them."""
    if abs(twist.omega) * _STRAIGHT_RADIUS_M <= twist.speed():
        times = _along_line(points, outline, twist)
    else:
        times = _along_arc(points, outline, twist)
    inside = outline.contains(points)
    within = points[inside]
    grazed = contact_times(within, outline.body(), twist) if outline.margin > 0.0 and len(within) else math.inf
    times[inside] = np.where(_gets_deeper(within, outline, twist), 0.0, grazed)
    return times


def _along_line(points: Floats, outline: Outline, twist: Twist2) -> Floats:
    """The slab test: a ray against a box."""
    enter = np.full(len(points), -math.inf)
    leave = np.full(len(points), math.inf)
    for axis, low, high, speed in (
        (0, outline.rear, outline.front, -twist.vx),
        (1, -outline.half, outline.half, -twist.vy),
    ):
        rate = math.copysign(max(abs(speed), _TINY), speed)
        first, second = (low - points[:, axis]) / rate, (high - points[:, axis]) / rate
        enter = np.maximum(enter, np.minimum(first, second))
        leave = np.minimum(leave, np.maximum(first, second))
    return np.where((enter <= leave) & (enter >= 0.0), enter, math.inf)


def _along_arc(points: Floats, outline: Outline, twist: Twist2) -> Floats:
    """Circles around the centre of rotation against the four edges, each of which they cross twice at most."""
    cx, cy = -twist.vy / twist.omega, twist.vx / twist.omega
    x, y = points[:, 0] - cx, points[:, 1] - cy
    radius = np.hypot(x, y)
    nearest, farthest = _radii(outline, cx, cy)
    crossing = np.flatnonzero((radius >= nearest) & (radius <= farthest))
    r = np.maximum(radius[crossing], _TINY)
    start = np.arctan2(y[crossing], x[crossing])
    first = np.full(len(crossing), math.inf)
    for edge in (outline.front - cx, outline.rear - cx):
        cosine = edge / r
        angle = np.arccos(np.clip(cosine, -1.0, 1.0))
        for at in (angle, -angle):
            on_edge = (np.abs(cosine) <= 1.0) & (np.abs(cy + r * np.sin(at)) <= outline.half)
            first = np.minimum(first, _turn_to(start, at, twist.omega, on_edge))
    for edge in (outline.half - cy, -outline.half - cy):
        sine = edge / r
        angle = np.arcsin(np.clip(sine, -1.0, 1.0))
        for at in (angle, math.pi - angle):
            along = cx + r * np.cos(at)
            on_edge = (np.abs(sine) <= 1.0) & (along >= outline.rear) & (along <= outline.front)
            first = np.minimum(first, _turn_to(start, at, twist.omega, on_edge))
    times = np.full(len(points), math.inf)
    times[crossing] = first / abs(twist.omega)
    return times


def _turn_to(start: Floats, at: Floats, omega: float, on_edge: NDArray[np.bool_]) -> Floats:
    """(n,) rad that a point turns from ``start`` until ``at``, opposite to the robot's turn; inf if not on the edge."""
    return np.where(on_edge, np.mod((start - at) * math.copysign(1.0, omega), 2.0 * math.pi), math.inf)


def _radii(outline: Outline, cx: float, cy: float) -> tuple[float, float]:
    """Nearest and farthest point of the outline from the centre of rotation, m."""
    dx = max(cx - outline.front, outline.rear - cx, 0.0)
    dy = max(abs(cy) - outline.half, 0.0)
    far_x = max(abs(outline.front - cx), abs(outline.rear - cx))
    return math.hypot(dx, dy), math.hypot(far_x, abs(cy) + outline.half)


def _gets_deeper(points: Floats, outline: Outline, twist: Twist2) -> NDArray[np.bool_]:
    """(n,) which of the points inside move away from the edge that is nearest to them."""
    x, y = points[:, 0], points[:, 1]
    ux, uy = twist.omega * y - twist.vx, -twist.omega * x - twist.vy
    depths = np.stack([outline.front - x, x - outline.rear, outline.half - y, y + outline.half])
    inwards = np.stack([-ux, ux, -uy, uy])
    nearest = np.argmin(depths, axis=0)
    deeper: NDArray[np.bool_] = np.take_along_axis(inwards, nearest[None, :], axis=0)[0] > _INWARDS * np.hypot(ux, uy)
    return deeper
