"""Detection of wheel slip: the distance between two matches against the distance by wheels and gyro."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from robot_stack.core.geometry import Pose2
from robot_stack.localization.ndt.matcher import Match
from robot_stack.localization.ndt.params import SlipParams


@dataclass(frozen=True, slots=True)
class Slip:
    """Distances in m over ``over_s``, up to ``stamp_s``: by the matches, and by wheels and gyro.

    rate_mps: rate of their divergence, over the whole window or from the last match to this one, whichever is more.
    """

    stamp_s: float
    over_s: float
    seen_m: float
    odometry_m: float
    rate_mps: float

    def off_m(self, stamp_s: float) -> float:
        """Error of dead reckoning from this match to ``stamp_s`` if the slip continues at the same rate."""
        return self.rate_mps * max(0.0, stamp_s - self.stamp_s)

    def __str__(self) -> str:
        return f"{self.odometry_m:.2f} m by the wheels, {self.seen_m:.2f} m by the map in {self.over_s:.1f} s"


@dataclass(frozen=True, slots=True)
class _Sight:
    stamp_s: float
    matched: Pose2
    travelled: Pose2
    variance_m2: float


class SlipWitness:
    """Compares matches in the order of their stamps. Poses are compared over ``window_s``, not between successive
    matches: the noise of two matches stays the same, a slip grows.
    """

    def __init__(self, params: SlipParams) -> None:
        self._params = params
        self._sights: deque[_Sight] = deque()

    def clear(self) -> None:
        """The pose was found by a search, or the motion in between is unknown."""
        self._sights.clear()

    def see(self, stamp_s: float, match: Match, travelled: Pose2) -> Slip | None:
        """The slip up to this match, None without one. travelled: base_link at ``stamp_s`` by wheels and gyro alone."""
        p = self._params
        newest = _Sight(stamp_s, match.planar, travelled, match.position_variances_m2[1])
        while self._sights and stamp_s - self._sights[0].stamp_s > p.window_s:
            self._sights.popleft()
        oldest, last = (self._sights[0], self._sights[-1]) if self._sights else (newest, newest)
        self._sights.append(newest)
        by_odometry = travelled.relative_to(oldest.travelled)
        odometry_m = math.hypot(by_odometry.x, by_odometry.y)
        apart_m = _apart_m(oldest, newest)
        doubt_m = p.sigmas * math.sqrt(newest.variance_m2 + oldest.variance_m2) + p.share * odometry_m
        if apart_m <= max(p.least_m, doubt_m):
            return None
        over_s = stamp_s - oldest.stamp_s
        rate_mps = max(apart_m / over_s, _apart_m(last, newest) / (stamp_s - last.stamp_s))
        return Slip(stamp_s, over_s, oldest.matched.distance_to(newest.matched), odometry_m, rate_mps)


def _apart_m(old: _Sight, new: _Sight) -> float:
    """Distance between the matched and the dead-reckoned position, relative to an earlier match."""
    return new.matched.relative_to(old.matched).distance_to(new.travelled.relative_to(old.travelled))
