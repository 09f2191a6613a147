"""Can this sweep be trusted? Frozen, covered, blind, or stamped with a time that cannot be."""

from __future__ import annotations

import math
import zlib
from collections import deque
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.point_cloud import Points
from robot_stack.core.robot import Robot
from robot_stack.perception.params import WatchParams
from robot_stack.perception.polar import angle_of

Int = NDArray[np.int32]
_FINE = 10  # directions looked at in each sector


class Watch:
    """Looks at every sweep before it is used."""

    def __init__(self, params: WatchParams) -> None:
        self._params = params
        self._stamp_s = -math.inf
        self._prints: deque[int] = deque(maxlen=params.remembered)
        self._seen_s = np.full(params.sectors, math.nan)  # when each direction was seen last
        self._judged_s = -math.inf
        self.dark = np.zeros(params.sectors, np.bool_)  # directions that are blind now

    def stamp_problem(self, stamp_s: float, now_s: float) -> str:
        """Why a stamp cannot be used, empty if it can. It must be newer than the last one that could."""
        params, age_s = self._params, now_s - stamp_s
        if not math.isfinite(stamp_s) or age_s < -params.stamp_future_s:
            return f"stamp is {-age_s:.3f} s in the future, limit {params.stamp_future_s} s"
        if age_s > params.stamp_old_s:
            return f"stamp is {age_s:.2f} s old, limit {params.stamp_old_s} s"
        if self._stamp_s - now_s > params.stamp_future_s:
            self._stamp_s = -math.inf  # the clock was set back
        if stamp_s <= self._stamp_s:
            return f"stamp does not go on: {stamp_s:.3f} s after {self._stamp_s:.3f} s"
        self._stamp_s = stamp_s
        return ""

    def frozen(self, points: Points) -> bool:
        """True if these very points came before: the noise of a living sensor never repeats."""
        sample = points[:: self._params.sample]
        fingerprint = len(points)
        for name in ("x", "y", "z"):
            fingerprint = zlib.crc32(np.ascontiguousarray(sample[name]).tobytes(), fingerprint)
        known = fingerprint in self._prints
        self._prints.append(fingerprint)
        return known and len(points) > 0

    def blind(self, points: Points, stamp_s: float, excused: NDArray[np.bool_] | None = None) -> str:
        """Why the sensor does not see, empty if it does. points: one half or full sweep in the sensor frame, m.

        A half sweep shows half of the directions, and a message may be lost: a direction is blind when it has shown
        nothing for ``sector_silent_s``. Up to ``blind_sectors_max`` of them are no reason but ``dark``: a wall nearer
        than the sensor's range blinds it as dirt does. excused: (sectors,) directions that need not show anything.
        """
        params = self._params
        counts = np.zeros(params.sectors, np.int32)
        x, y, z = (np.ascontiguousarray(points[name]) for name in ("x", "y", "z"))
        _count(x, y, z, np.float32(params.seen_min_m), counts)
        if not 0.0 <= stamp_s - self._judged_s <= params.sector_silent_s:
            self._seen_s[:] = stamp_s  # after silence all directions are given the time of one turn
        self._judged_s = stamp_s
        self._seen_s[counts >= params.sector_points_min] = stamp_s
        total = int(counts.sum())
        if total < params.points_min:
            return f"covered: {total} returns, at least {params.points_min} expected"
        late = stamp_s - self._seen_s > params.sector_silent_s
        self.dark = late if excused is None else late & ~excused
        dark = np.flatnonzero(self.dark)
        if len(dark) <= params.blind_sectors_max:
            return ""
        width = 360.0 / params.sectors
        where = ", ".join(f"{-180.0 + width * int(i):.0f}" for i in dark[:4])
        return f"blind in {len(dark)} of {params.sectors} directions, from {where} deg"


def hidden_by_chair(robot: Robot, sectors: int) -> NDArray[np.bool_]:
    """(sectors,) directions from the LiDAR that meet the attached chair, nearer perhaps than the sensor can see."""
    x, y = robot.lidar_xyz_m[0], robot.lidar_xyz_m[1]
    chair, half = robot.footprint_with_chair, 0.5 * robot.footprint_with_chair.width_m
    angles = (np.arange(sectors * _FINE) + 0.5) * (2.0 * math.pi / (sectors * _FINE)) - math.pi
    reach = robot.footprint.front_m - x
    with np.errstate(divide="ignore"):
        sideways = y + np.tan(angles) * reach
    meets = (np.cos(angles) > 0.0) & (np.abs(sideways) <= half) & (chair.front_m > robot.footprint.front_m)
    found: NDArray[np.bool_] = meets.reshape(sectors, _FINE).any(axis=1)
    return found


@numba.njit(cache=True)
def _count(x: Any, y: Any, z: Any, least: Any, counts: Int) -> None:
    per_rad = np.float32(len(counts) / (2.0 * math.pi))
    for i in range(len(x)):
        square = x[i] * x[i] + y[i] * y[i] + z[i] * z[i]
        if least * least <= square < np.float32(1e8):  # false for NaN
            sector = int((angle_of(y[i], x[i]) + np.float32(math.pi)) * per_rad)
            counts[min(max(sector, 0), len(counts) - 1)] += 1
