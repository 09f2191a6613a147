"""The sweeps of a ride, or of several, and what is known about where they were taken."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robot_stack.core.geometry import Pose2
from robot_stack.mapping.lidar_odometry import lidar_odometry
from robot_stack.mapping.loops import Loop, candidates, close_loops
from robot_stack.mapping.params import MappingParams
from robot_stack.mapping.pose_graph import Edges, Indices
from robot_stack.mapping.poses import Floats, inverse, planar, yaw_of
from robot_stack.mapping.ride import Ride, driven
from robot_stack.mapping.trajectory import Knowledge, knowledge_of

# (step, items done, items in all)
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class Course:
    """sweeps: (k, 3) points in base_link each. ride: (n,) number of each one's ride. wheels, lidar: (n, 4, 4) poses by
    odometry alone; poses: the best estimate so far. Rides follow one another.
    """

    sweeps: list[Floats]
    stamps_s: Floats
    ride: Indices
    wheels: Floats
    lidar: Floats
    knowledge: Knowledge
    poses: Floats
    loops: tuple[Loop, ...] = ()

    def solved(self, start: Floats | None, params: MappingParams, more: Sequence[Edges] = ()) -> Course:
        """With the poses that agree best with all; start: of the first one, None: free."""
        poses = self.knowledge.solve(self.poses, start, self.loops, params.loops, more)
        return replace(self, poses=poses)

    def followed_by(self, other: Course) -> Course:
        """Both in one; ``other`` is in the same frame."""
        count = len(self.sweeps)
        later = [replace(loop, earlier=loop.earlier + count, later=loop.later + count) for loop in other.loops]
        return Course(
            self.sweeps + other.sweeps,
            np.concatenate([self.stamps_s, other.stamps_s]),
            np.concatenate([self.ride, other.ride + self.ride[-1] + 1]),
            np.concatenate([self.wheels, other.wheels]),
            np.concatenate([self.lidar, other.lidar]),
            self.knowledge.followed_by(other.knowledge, count),
            np.concatenate([self.poses, other.poses]),
            (*self.loops, *later),
        )


def course_of(ride: Ride, start: Pose2, params: MappingParams, progress: Progress) -> Course:
    """One ride, begun at ``start``, its loops closed."""
    sweeps = [sweep.points.astype(np.float64) for sweep in ride.sweeps]
    wheels = begun_at(driven(ride), start)
    progress("LiDAR odometry", 0, 1)
    lidar, matched = lidar_odometry(sweeps, wheels, params.lidar_odometry)
    knowledge = knowledge_of(ride, wheels, lidar, matched, params)
    stamps = np.array([sweep.stamp_s for sweep in ride.sweeps])
    course = Course(sweeps, stamps, np.zeros(len(sweeps), np.int64), wheels, lidar, knowledge, wheels)
    first = planar(start.x, start.y, start.yaw)
    return closed(course.solved(first, params), first, params, progress)


def closed(course: Course, start: Floats, params: MappingParams, progress: Progress) -> Course:
    """Loops closed: within the ride, or with several rides between them.

    Two rounds: corrected poses show further places that are near each other.
    """
    before = course.loops
    for turn in ("loops", "loops again"):
        pairs = candidates(course.poses, course.stamps_s, course.ride, params.loops)
        tick = ticks(progress, turn, len(pairs))
        found = close_loops(course.sweeps, course.poses, course.ride, pairs, params.loops, tick)
        course = replace(course, loops=(*before, *found)).solved(start, params)
    return course


def begun_at(poses: Floats, start: Pose2) -> Floats:
    """The same path, begun at ``start``; its slopes stay as they are."""
    first = planar(poses[0, 0, 3], poses[0, 1, 3], float(yaw_of(poses[:1])[0]))
    return planar(start.x, start.y, start.yaw) @ inverse(first) @ poses


def ticks(progress: Progress, what: str, total: int) -> Callable[[], None]:
    """Reports one more item done of ``total`` at each call."""
    done = iter(range(1, total + 1))
    progress(what, 0, total)
    return lambda: progress(what, next(done, total), total)
