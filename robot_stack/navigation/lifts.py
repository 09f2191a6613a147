"""Ways across levels: to the cabin of a lift, the ride in it, and on.

The levels lie side by side in the map's plane (``core/levels.py``), so a ride moves the pose from the cabin's place in
one level to that in the other. The stage of a goal follows from the robot's pose alone: a restarted navigation
goes on in the cabin. A robot in the cabin leaves its level in the map only once the building reports
the door of the other level open for it, and the cabin only by the door of its level in the map (``doors.py``).
"""

from __future__ import annotations

import heapq
import itertools
from dataclasses import dataclass

from robot_stack.core.geometry import Pose2
from robot_stack.core.levels import Levels, Stop


@dataclass(frozen=True, slots=True)
class Stage:
    """What comes first on the way to a goal.

    goal: on the robot's own level, the cabin's place on the way to another one. door: of the cabin to which it leads,
    else empty. ride: the robot is in this cabin and rides in it; None otherwise. beyond_m: length of the way behind
    ``goal``, in the map's plane.
    """

    goal: Pose2
    door: str = ""
    ride: Ride | None = None
    beyond_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Ride:
    lift: str
    level: str  # the wanted one
    start: Stop
    end: Stop

    def arrival(self, pose: Pose2) -> Pose2:
        """The pose in the cabin at the wanted level, of a robot at ``pose`` at the present one."""
        return self.end.pose.compose(pose.relative_to(self.start.pose))


class Lifts:
    """The way with the least length in the plane, over any number of lifts."""

    def __init__(self, levels: Levels) -> None:
        self._levels = levels

    def is_in(self, ride: Ride, stop: Stop, pose: Pose2) -> bool:
        """Whether ``pose`` is in the cabin of the ride at ``stop``."""
        return pose.distance_to(stop.pose) <= self._levels.lifts[ride.lift].radius_m

    def stage(self, pose: Pose2, goal: Pose2) -> Stage | None:
        """None if no lift leads to the goal's level. The stage has a ride if ``pose`` is in the cabin; the caller
        knows whether the footprint is clear of its door.
        """
        here, there = self._levels.level_at(pose), self._levels.level_at(goal)
        if here == there or here is None or there is None:
            return Stage(goal)
        found = self._way(pose, here, goal, there)
        if found is None:
            return None
        length_m, ride = found
        inside = self.is_in(ride, ride.start, pose)
        beyond_m = length_m - pose.distance_to(ride.start.pose)
        return Stage(ride.start.pose, ride.start.door, ride if inside else None, beyond_m)

    def _way(self, pose: Pose2, here: str, goal: Pose2, there: str) -> tuple[float, Ride] | None:
        """Dijkstra: the length of the whole way, and its first ride."""
        count = itertools.count()  # equal lengths in the order of the file
        queue: list[tuple[float, int, str, Pose2, Ride | None]] = [(0.0, next(count), here, pose, None)]
        left: set[tuple[str, Pose2]] = set()
        while queue:
            length_m, _, level, at, first = heapq.heappop(queue)
            if at is goal and first is not None:
                return length_m, first
            if level == there:
                heapq.heappush(queue, (length_m + at.distance_to(goal), next(count), level, goal, first))
            elif (level, at) not in left:
                left.add((level, at))
                for name, lift in self._levels.lifts.items():
                    start = lift.stops.get(level)
                    for other, end in lift.stops.items() if start is not None else ():
                        if start is None or other == level:
                            continue
                        to_m = at.distance_to(start.pose) + start.pose.distance_to(end.pose)
                        step = first or Ride(name, other, start, end)
                        heapq.heappush(queue, (length_m + to_m, next(count), other, end.pose, step))
        return None
