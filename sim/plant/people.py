"""People who walk through the world: their poses by simulated time and the robot's pose.

A person walks to and fro along a line and stops while robot or chair is close ahead: people do not walk into machines,
but into their way. After waiting for a while a person turns back.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from robot_stack.core.geometry import Pose2, wrap_angle
from robot_stack.core.robot import Footprint
from sim.polyline import Polyline
from sim.worldfile import Person

PREFIX = "person_"  # of the body's name
RADIUS_M, HEIGHT_M = 0.25, 1.75
# A person stops at this distance between body and machine, if the machine is within this angle of the way.
_ROOM_M = 0.6
_AHEAD_COS = 0.4
_PATIENCE_S = 4.0
_RESUME_STEP_S = 0.05


class Walker:
    """One person."""

    def __init__(self, person: Person) -> None:
        self.name = f"{PREFIX}{person.name}"
        self._person = person
        self._line = Polyline(person.points_m)
        self._walked_s = 0.0
        self._waited_s = 0.0
        self._pose = self.pose_after(0.0)

    def pose(self) -> Pose2:
        """In map, facing the way of the walk."""
        return self._pose

    def pose_after(self, walked_s: float) -> Pose2:
        """The pose after this time of undisturbed walking and resting."""
        person = self._person
        length_m = self._line.length_m
        if not length_m:
            return self._line.pose_at(0.0)
        one_way_s, half_s = length_m / person.speed_mps, self._half_s()
        turns, into_s = divmod(walked_s, half_s)
        done_m = min(into_s, one_way_s) * person.speed_mps
        if int(turns) % 2 == 0:
            return self._line.pose_at(done_m)
        out = self._line.pose_at(length_m - done_m)
        return Pose2(out.x, out.y, math.remainder(out.yaw + math.pi, math.tau))

    def step(self, dt_s: float, machine: Pose2, footprint: Footprint) -> None:
        """Walks on, unless the machine (base_link in map, its footprint) is in the way: then waits, and turns back."""
        if not in_the_way(self._pose, machine, footprint):
            self._walk_to(self._walked_s + dt_s)
            self._waited_s = 0.0
            return
        self._waited_s += dt_s
        if self._waited_s >= _PATIENCE_S:
            self._waited_s = 0.0
            self._turn_back()

    def resume_at(self, pose: Pose2) -> None:
        """Continues the walk from its pose nearest to ``pose``; at an end the rest begins anew."""
        steps = math.ceil(2.0 * self._half_s() / _RESUME_STEP_S)
        self._walk_to(min((_RESUME_STEP_S * step for step in range(steps)), key=lambda at_s: self._off(at_s, pose)))
        self._waited_s = 0.0

    def _off(self, walked_s: float, pose: Pose2) -> float:
        """Distance of the pose after this walk, and of its heading, of which 1 rad counts as 1 m."""
        error = self.pose_after(walked_s).relative_to(pose)
        return math.hypot(error.x, error.y) + abs(wrap_angle(error.yaw))

    def _half_s(self) -> float:
        """Time for one way and the rest at its end."""
        return self._line.length_m / self._person.speed_mps + self._person.pause_s

    def _turn_back(self) -> None:
        """Turns to the same place in the other direction; a person who rests at an end keeps resting."""
        one_way_s, half_s = self._line.length_m / self._person.speed_mps, self._half_s()
        turns, into_s = divmod(self._walked_s, half_s)
        if into_s < one_way_s:
            self._walk_to((turns + 1.0) * half_s + one_way_s - into_s)

    def _walk_to(self, walked_s: float) -> None:
        self._walked_s = walked_s
        self._pose = self.pose_after(walked_s)


def walkers(people: Iterable[Person]) -> list[Walker]:
    return [Walker(person) for person in people]


def in_the_way(person: Pose2, machine: Pose2, footprint: Footprint) -> bool:
    """True if the machine is close ahead of a person, or touches them."""
    reach_m = max(footprint.front_m, -footprint.rear_m) + footprint.width_m + RADIUS_M + _ROOM_M
    if abs(person.x - machine.x) > reach_m or abs(person.y - machine.y) > reach_m:
        return False  # nearly always: saves the exact test
    seen = person.relative_to(machine)
    half = 0.5 * footprint.width_m
    dx = min(max(seen.x, footprint.rear_m), footprint.front_m) - seen.x
    dy = min(max(seen.y, -half), half) - seen.y
    far = math.hypot(dx, dy)
    if far > RADIUS_M + _ROOM_M:
        return False
    return dx * math.cos(seen.yaw) + dy * math.sin(seen.yaw) >= _AHEAD_COS * far
