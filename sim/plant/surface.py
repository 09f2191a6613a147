"""Friction of the ground under each wheel."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from sim.worldfile import Patch, WorldFile


@dataclass(frozen=True)
class Area:
    """A rectangle of ground in the map frame: centre and half sizes in m, turned by yaw; friction coefficient."""

    x_m: float
    y_m: float
    yaw_rad: float
    half_length_m: float
    half_width_m: float
    friction: float

    def contains(self, x_m: float, y_m: float) -> bool:
        dx, dy = x_m - self.x_m, y_m - self.y_m
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return abs(c * dx + s * dy) <= self.half_length_m and abs(c * dy - s * dx) <= self.half_width_m

    @cached_property
    def reach_m(self) -> float:
        """From the centre to a corner."""
        return math.hypot(self.half_length_m, self.half_width_m)


class Surface:
    """The friction coefficient anywhere, with areas and single wheels made slippery at run time."""

    def __init__(self, world: WorldFile) -> None:
        self._friction = world.friction
        self._fixed = [_area(patch) for patch in world.patches]
        self._temporary: dict[str, Area] = {}
        self._areas = self._fixed
        self._wheels: dict[int, float] = {}

    def is_uniform(self, x_m: float, y_m: float, within_m: float) -> bool:
        """True if every wheel within a distance of a place has the world's own friction."""
        if self._wheels:
            return False
        for area in self._areas:
            far = within_m + area.reach_m
            if abs(x_m - area.x_m) <= far and abs(y_m - area.y_m) <= far:
                return False
        return True

    def friction_at(self, x_m: float, y_m: float, wheel: int) -> float:
        """Friction coefficient of wheel 0-3 at a place. The smallest of all areas there counts."""
        values = [area.friction for area in self._areas if area.contains(x_m, y_m)]
        values.append(self._wheels.get(wheel, math.inf))
        return min(values) if min(values) < math.inf else self._friction

    def add_area(self, name: str, area: Area) -> None:
        self._temporary[name] = area
        self._areas = [*self._fixed, *self._temporary.values()]

    def remove_area(self, name: str) -> None:
        self._temporary.pop(name, None)
        self._areas = [*self._fixed, *self._temporary.values()]

    def set_wheel(self, wheel: int, friction: float | None) -> None:
        """Sets a friction for one wheel at any place; None removes it."""
        if friction is None:
            self._wheels.pop(wheel, None)
        else:
            self._wheels[wheel] = friction


def _area(patch: Patch) -> Area:
    return Area(patch.x_m, patch.y_m, patch.yaw_rad, 0.5 * patch.length_m, 0.5 * patch.width_m, patch.friction)
