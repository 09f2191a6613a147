"""People who walk through the world: where each of them is, from simulated time alone and from where the robot stands.

A person walks to and fro along a line and stops while robot or chair is close ahead: people do not walk into machines,
but they do walk in their way. Somebody who has waited for a while turns back.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable

from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import Footprint
from sim.worldfile import Person

PREFIX = "person_"  # of the body's name
RADIUS_M, HEIGHT_M = 0.25, 1.75
# A person stops with this much room between body and machine, if the machine is within this angle of the way.
_ROOM_M = 0.6
_AHEAD_COS = 0.4
_PATIENCE_S = 4.0


class Walker:
    """One person."""

    def __init__(self, person: Person) -> None:
        self.name = f"{PREFIX}{person.name}"
        self._person = person
        points = person.points_m
        self._legs = [(a, b, math.dist(a, b)) for a, b in itertools.pairwise(points)]
        self._length_m = sum(length for _, _, length in self._legs)
        self._walked_s = 0.0
        self._waited_s = 0.0
        self._pose = self.pose_after(0.0)

    def pose(self) -> Pose2:
        """In map, facing the way of the walk."""
        return self._pose

    def pose_after(self, walked_s: float) -> Pose2:
        """After so much time of walking and resting that nobody disturbed."""
        person = self._person
        if not self._legs:
            return Pose2(*person.points_m[0], 0.0)
        one_way_s = self._length_m / person.speed_mps
        half_s = one_way_s + person.pause_s
        turns, into_s = divmod(walked_s, half_s)
        done_m = min(into_s, one_way_s) * person.speed_mps
        back = int(turns) % 2 == 1
        return self._on_line(self._length_m - done_m if back else done_m, back)

    def step(self, dt_s: float, machine: Pose2, footprint: Footprint) -> None:
        """Walks on, unless the machine (base_link in map, its footprint) is in the way: then after a while back."""
        if not in_the_way(self._pose, machine, footprint):
            self._walk_to(self._walked_s + dt_s)
            self._waited_s = 0.0
            return
        self._waited_s += dt_s
        if self._waited_s >= _PATIENCE_S:
            self._waited_s = 0.0
            self._turn_back()

    def _turn_back(self) -> None:
        """To the same place on the way in the other direction; who rests at an end goes on resting."""
        one_way_s = self._length_m / self._person.speed_mps
        half_s = one_way_s + self._person.pause_s
        turns, into_s = divmod(self._walked_s, half_s)
        if into_s < one_way_s:
            self._walk_to((turns + 1.0) * half_s + one_way_s - into_s)

    def _walk_to(self, walked_s: float) -> None:
        self._walked_s = walked_s
        self._pose = self.pose_after(walked_s)

    def _on_line(self, along_m: float, back: bool) -> Pose2:
        for (x0, y0), (x1, y1), length in self._legs:
            if along_m <= length or (x1, y1) == self._person.points_m[-1]:
                share = min(1.0, along_m / length)
                yaw = math.atan2(y1 - y0, x1 - x0) + (math.pi if back else 0.0)
                return Pose2(x0 + share * (x1 - x0), y0 + share * (y1 - y0), math.remainder(yaw, math.tau))
            along_m -= length
        raise AssertionError("a line ends with its last point")


def walkers(people: Iterable[Person]) -> list[Walker]:
    return [Walker(person) for person in people]


def in_the_way(person: Pose2, machine: Pose2, footprint: Footprint) -> bool:
    """The machine is close ahead of a person, or already touches."""
    reach_m = max(footprint.front_m, -footprint.rear_m) + footprint.width_m + RADIUS_M + _ROOM_M
    if abs(person.x - machine.x) > reach_m or abs(person.y - machine.y) > reach_m:
        return False  # nearly always: spares the exact look
    seen = person.relative_to(machine)
    half = 0.5 * footprint.width_m
    dx = min(max(seen.x, footprint.rear_m), footprint.front_m) - seen.x
    dy = min(max(seen.y, -half), half) - seen.y
    far = math.hypot(dx, dy)
    if far > RADIUS_M + _ROOM_M:
        return False
    return dx * math.cos(seen.yaw) + dy * math.sin(seen.yaw) >= _AHEAD_COS * far
