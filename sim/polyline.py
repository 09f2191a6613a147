"""A line through points, for a route or the walk of a person."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from robot_stack.core.geometry import Pose2

Point = tuple[float, float]


class Polyline:
    """points: one or more in map, m. length_m: from the first to the last one along the line."""

    def __init__(self, points: Sequence[Point]) -> None:
        self._first, self._last = points[0], points[-1]
        self._legs = [(a, b, math.dist(a, b)) for a, b in itertools.pairwise(points)]
        self.length_m = sum(length_m for _, _, length_m in self._legs)

    def pose_at(self, along_m: float) -> Pose2:
        """The pose at a distance on the line, along it; past the end the last point. A single point faces east."""
        for (x0, y0), (x1, y1), length_m in self._legs:
            if along_m <= length_m or (x1, y1) == self._last:
                share = min(1.0, along_m / length_m)
                return Pose2(x0 + share * (x1 - x0), y0 + share * (y1 - y0), math.atan2(y1 - y0, x1 - x0))
            along_m -= length_m
        return Pose2(*self._first, 0.0)

    def distance_m(self, x: float, y: float) -> float:
        """From (x, y) to the nearest place of the line."""
        legs = ((a, b) for a, b, _ in self._legs) if self._legs else ((self._first, self._first),)
        return min(_to_segment_m(x, y, a, b) for a, b in legs)


def _to_segment_m(x: float, y: float, a: Point, b: Point) -> float:
    dx, dy = b[0] - a[0], b[1] - a[1]
    share = max(0.0, min(1.0, ((x - a[0]) * dx + (y - a[1]) * dy) / max(dx * dx + dy * dy, 1e-12)))
    return math.hypot(x - a[0] - share * dx, y - a[1] - share * dy)
