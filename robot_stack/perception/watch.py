"""Plausibility of a sweep: detects a frozen, covered or blind sensor, and an invalid stamp."""

from __future__ import annotations

import math
import zlib
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.core.geometry import Pose2
from robot_stack.core.point_cloud import Points
from robot_stack.core.robot import Robot
from robot_stack.perception.crop import readable
from robot_stack.perception.params import WatchParams
from robot_stack.perception.polar import angle_of

Int = NDArray[np.int32]
DIRECTIONS = 360  # in which missing low beams are detected
_BLOCK = 256  # points per block: their coordinates stay in the fastest cache


class Watch:
    """Checks every sweep before it is used. height_m: of the sensor above the ground."""

    def __init__(self, params: WatchParams, height_m: float) -> None:
        self._params = params
        self._stamp_s = -math.inf
        self._prints: deque[int] = deque(maxlen=params.remembered)
        self._seen_s = np.full(params.sectors, math.nan)  # time of the last return in each direction
        self._judged_s = -math.inf
        self._low_seen_s = np.full(DIRECTIONS, math.nan)  # when a low beam of each fine direction returned last
        self._low_slope = np.float32(height_m / params.low_beam_m)
        self.blind_sectors = np.zeros(params.sectors, np.bool_)  # directions that are blind now
        self.obstructed = np.zeros(DIRECTIONS, np.bool_)  # covered by dirt or an object too near to be measured

    def stamp_problem(self, stamp_s: float, now_s: float) -> str:
        """Why a stamp cannot be used, empty if it can. It must be newer than the last one that could."""
        params, age_s = self._params, now_s - stamp_s
        if not math.isfinite(stamp_s) or age_s < -params.stamp_future_s:
            return f"stamp is {-age_s:.3f} s in the future, limit {params.stamp_future_s} s"
        if age_s > params.stamp_old_s:
            return f"stamp is {age_s:.2f} s old, limit {params.stamp_old_s} s"
        if self._stamp_s - now_s > params.stamp_future_s:
            self._stamp_s = -math.inf  # clock set back
        if stamp_s <= self._stamp_s:
            return f"stamp does not increase: {stamp_s:.3f} s after {self._stamp_s:.3f} s"
        self._stamp_s = stamp_s
        return ""

    def frozen(self, points: Points) -> bool:
        """True if the same points came before: the noise of a working sensor never repeats."""
        sample = points[:: self._params.sample]
        fingerprint = len(points)
        for name in ("x", "y", "z"):
            fingerprint = zlib.crc32(np.ascontiguousarray(sample[name]).tobytes(), fingerprint)
        known = fingerprint in self._prints
        self._prints.append(fingerprint)
        return known and len(points) > 0

    def blind(self, points: Points, stamp_s: float, excused: NDArray[np.bool_] | None = None) -> str:
        """Why the sensor is blind, empty if it is not. points: one half or full sweep in the sensor frame, m.

        A half sweep shows half of the directions, and a message may be lost: a direction is blind when it has shown
        nothing for ``sector_silent_s``. Up to ``blind_sectors_max`` of them are no reason but ``blind_sectors``: a
        wall nearer than the sensor's range blinds it as dirt does. So does what stands near below the horizon, only
        for low beams: a pole or a child is ``obstructed`` where none of them returns. What belongs to robot and
        chair returns, too;
        excused: (sectors,) where the chair is too near for that.
        """
        params = self._params
        counts, low = np.zeros(params.sectors, np.int32), np.zeros(DIRECTIONS, np.int32)
        x, y, z = readable(points, "x", "y", "z")
        _count(x, y, z, np.float32(params.seen_min_m), self._low_slope, counts, low)
        if not 0.0 <= stamp_s - self._judged_s <= params.sector_silent_s:
            self._seen_s[:] = self._low_seen_s[:] = stamp_s  # after silence all are given the time of one turn
        self._judged_s = stamp_s
        self._seen_s[counts >= params.sector_points_min] = stamp_s
        self._low_seen_s[low > 0] = stamp_s
        total = int(counts.sum())
        if total < params.points_min:
            return f"covered: {total} returns, at least {params.points_min} expected"
        judged = np.ones(params.sectors, np.bool_) if excused is None else ~excused
        self.blind_sectors = judged & (stamp_s - self._seen_s > params.sector_silent_s)
        missed = _wide(stamp_s - self._low_seen_s > params.sector_silent_s, params.obstructed_min)
        fine = DIRECTIONS // params.sectors
        self.obstructed = np.repeat(self.blind_sectors, fine) | (missed & np.repeat(judged, fine))
        blind_sectors = np.flatnonzero(self.blind_sectors)
        if len(blind_sectors) <= params.blind_sectors_max:
            return ""
        width = 360.0 / params.sectors
        where = ", ".join(f"{-180.0 + width * int(i):.0f}" for i in blind_sectors[:4])
        return f"blind in {len(blind_sectors)} of {params.sectors} directions, from {where} deg"


def too_near(robot: Robot, board: Pose2 | None, params: WatchParams) -> NDArray[np.bool_]:
    """(sectors,) directions from the LiDAR in which an attached chair is nearer than what counts as seen.

    board: the latched wheelchair's frame in base_link; it begins there. What is farther away must show itself: a
    direction that shows nothing at all is dirt, with a chair too.
    """
    if board is None:
        return np.zeros(params.sectors, np.bool_)
    x, y = robot.lidar_xyz_m[0], robot.lidar_xyz_m[1]
    half, reach = 0.5 * robot.footprint_with_chair.width_m, board.x - x
    angles = (np.arange(DIRECTIONS) + 0.5) * (2.0 * math.pi / DIRECTIONS) - math.pi
    ahead = np.maximum(np.cos(angles), 1e-9)
    sideways = y + np.sin(angles) / ahead * reach
    hits = (ahead > 1e-6) & (np.abs(sideways) <= half) & (reach / ahead < params.seen_min_m)
    found: NDArray[np.bool_] = hits.reshape(params.sectors, DIRECTIONS // params.sectors).any(axis=1)
    return found


def _wide(found: NDArray[np.bool_], least: int) -> NDArray[np.bool_]:
    """(n,) of some directions around the circle those with ``least`` neighbours in a row, themselves included."""
    around = np.concatenate([found[-least:], found, found[:least]]).astype(np.int64)
    runs = np.convolve(around, np.ones(least, np.int64), "valid") == least
    wide = np.zeros(len(around), np.bool_)
    for step in range(least):
        wide[step : step + len(runs)] |= runs
    return wide[least:-least]


@compiled(error_model="numpy")
def _count(x: Any, y: Any, z: Any, least: Any, slope: Any, counts: Int, low: Int) -> None:
    """Returns by sector; low: of beams that lead down by more than ``slope``, in finer directions."""
    per_rad, fine = np.float32(len(low) / (2.0 * math.pi)), len(low) // len(counts)
    px, py, pz = np.empty(_BLOCK, np.float32), np.empty(_BLOCK, np.float32), np.empty(_BLOCK, np.float32)
    sector = np.empty(_BLOCK, np.int32)
    for begin in range(0, len(x), _BLOCK):
        size = min(_BLOCK, len(x) - begin)
        for i in range(size):
            px[i], py[i], pz[i] = x[begin + i], y[begin + i], z[begin + i]
        for i in range(size):  # arithmetic alone, for vector code
            square = px[i] * px[i] + py[i] * py[i] + pz[i] * pz[i]
            at = np.int32((angle_of(py[i], px[i]) + np.float32(math.pi)) * per_rad)
            at = min(max(at, np.int32(0)), np.int32(len(low) - 1))
            sector[i] = at if least * least <= square < np.float32(1e8) else np.int32(-1)  # false for NaN
        for i in range(size):
            if sector[i] >= 0:
                counts[sector[i] // fine] += 1
                plan = px[i] * px[i] + py[i] * py[i]
                low[sector[i]] += pz[i] < np.float32(0.0) and pz[i] * pz[i] > slope * slope * plan
