"""The geometry of a plan: poses along the way, arc length, curvature, and projection of points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import Pose2, wrap_angle
from robot_stack.navigation.motion import Trajectory

Array = npt.NDArray[np.float64]
# Sampling period of a trajectory (3 cm at 1.5 m/s); a long one is sampled less often.
_SAMPLE_S, _MAX_SAMPLES = 0.02, 2000


@dataclass(frozen=True)
class Path:
    """A way of the body through the map. poses: (n, 3) of x, y (m) and yaw (rad, wrapped), n >= 1."""

    poses: Array

    @cached_property
    def arc_length_m(self) -> Array:
        """(n,) distance travelled up to each pose, from 0."""
        steps = np.hypot(*np.diff(self.poses[:, :2], axis=0).T)
        return np.concatenate(([0.0], np.cumsum(steps)))

    @property
    def length_m(self) -> float:
        return float(self.arc_length_m[-1])

    def end(self) -> Pose2:
        x, y, yaw = self.poses[-1]
        return Pose2(float(x), float(y), float(yaw))

    def project(self, x: float, y: float) -> tuple[float, float]:
        """(arc length of the nearest point, distance to it), m; distance is positive to the left of the way."""
        points = self.poses[:, :2]
        if len(points) == 1:
            return 0.0, math.dist((x, y), points[0])
        start, step = points[:-1], np.diff(points, axis=0)
        offset = np.array([x, y]) - start
        length2 = np.einsum("ij,ij->i", step, step)
        share = np.divide(np.einsum("ij,ij->i", offset, step), length2, out=np.zeros_like(length2), where=length2 > 0.0)
        share = np.clip(share, 0.0, 1.0)
        beside = offset - share[:, None] * step
        distance = np.hypot(*beside.T)
        i = int(np.argmin(distance))
        left = step[i, 0] * beside[i, 1] - step[i, 1] * beside[i, 0]
        along = self.arc_length_m[i] + share[i] * math.sqrt(length2[i])
        return float(along), math.copysign(float(distance[i]), left)


def path_of(trajectory: Trajectory, spacing_m: float, max_poses: int) -> Path:
    """The way of a trajectory: a pose about every ``spacing_m`` (and as many radians of yaw), both ends included."""
    samples = min(_MAX_SAMPLES, max(2, math.ceil(trajectory.duration_s / _SAMPLE_S)))
    times = np.linspace(0.0, trajectory.duration_s, samples)
    poses = [trajectory.at(float(time_s)).pose for time_s in times]
    effort = np.concatenate(([0.0], np.cumsum([_effort_m(a, b) for a, b in pairwise(poses)])))
    count = min(max_poses, max(2, math.ceil(float(effort[-1]) / spacing_m) + 1))
    picked = np.searchsorted(effort, np.linspace(0.0, effort[-1], count), side="left")
    picked[-1] = len(poses) - 1
    return Path(np.array([(poses[i].x, poses[i].y, poses[i].yaw) for i in np.unique(picked)]))


def _effort_m(a: Pose2, b: Pose2) -> float:
    return max(a.distance_to(b), abs(wrap_angle(b.yaw - a.yaw)))
