"""Converts the messages of a recording, in order of arrival, to a ride."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robot_stack.core.geometry import IDENTITY, Pose2, wrap_angle
from robot_stack.core.point_cloud import Points
from robot_stack.core.pose_history import StepLimit
from robot_stack.core.robot import Robot
from robot_stack.mapping.params import Sweeps as Settings
from robot_stack.mapping.poses import Floats
from robot_stack.mapping.ride import Ride, RideError, Sweep, Track, deskewed, track

# Odometry readings kept for one sweep: at 50 Hz over its 0.1 s, and those that arrived meanwhile.
_RECENT = 250
# A sweep waits this long for the odometry that was measured with it.
MOST_WAITING = 20
# Readings from so long before a sweep belong to it.
_AROUND_S = 1.0
# Odometry that steps by more than this beyond 1.5 times the robot's limits has restarted.
_JUMP_M, _JUMP_RAD, _FASTER = 0.05, 0.05, 1.5


class Collector:
    """Call for every message, then ``finish``. Sweeps are thinned at once: a ride of an hour fits into memory."""

    def __init__(self, settings: Settings, robot: Robot) -> None:
        self._settings = settings
        self._robot = robot
        fastest = _FASTER * robot.empty.max_speed_mps, _FASTER * robot.empty.max_yaw_rate_radps
        self._steps = StepLimit(*fastest, _JUMP_M, _JUMP_RAD)
        self._stamps: list[float] = []
        self._odometry: list[tuple[float, ...]] = []
        self._frame = IDENTITY  # of the odometry, in its first frame
        self._variance = 0.0
        self._imu_stamps: list[float] = []
        self._imu: list[tuple[float, ...]] = []
        self._waiting: deque[tuple[float, Points]] = deque()
        self._sweeps: list[Sweep] = []
        self._last: Floats | None = None
        self.restarts_s: list[float] = []
        self.sweeps = 0
        self.without_odometry = 0
        self.empty = 0

    def odometry(self, stamp_s: float, x_m: float, y_m: float, yaw_rad: float, variance: float = 0.0) -> None:
        """variance: sum of the pose's variances. If odometry restarts, the pose holds and continues from there."""
        if not all(map(math.isfinite, (stamp_s, x_m, y_m, yaw_rad))):
            return
        raw = Pose2(x_m, y_m, yaw_rad)
        pose = self._frame.compose(raw)
        if self._odometry:
            last = Pose2(*self._odometry[-1])
            if self._restarted(stamp_s - self._stamps[-1], pose.relative_to(last), variance):
                self.restarts_s.append(stamp_s)
                self._frame = last.compose(raw.inverse())
                pose = last
            pose = replace(pose, yaw=last.yaw + wrap_angle(pose.yaw - last.yaw))
        self._variance = variance
        self._stamps.append(stamp_s)
        self._odometry.append((pose.x, pose.y, pose.yaw))
        while self._waiting and self._waiting[0][0] <= stamp_s:
            self._take(*self._waiting.popleft())

    def _restarted(self, dt_s: float, step: Pose2, variance: float) -> bool:
        """True for a step that no wheel can drive, or a covariance that shrinks, which dead reckoning's never does."""
        return not self._steps.allows(step, dt_s) or (dt_s > 0.0 and variance < 0.5 * self._variance)

    def imu(self, stamp_s: float, roll_rad: float, pitch_rad: float, turn_rate_radps: float) -> None:
        """roll, pitch NaN where the unit gives no attitude."""
        self._imu_stamps.append(stamp_s)
        self._imu.append((roll_rad, pitch_rad, turn_rate_radps))

    def sweep(self, stamp_s: float, points: Points) -> None:
        """(n,) of layout SWEEP."""
        self.sweeps += 1
        self._waiting.append((stamp_s, points))
        if len(self._waiting) > MOST_WAITING:
            self._waiting.popleft()
            self.without_odometry += 1

    def finish(self) -> Ride:
        """Raises RideError."""
        self.without_odometry += len(self._waiting)
        self._waiting.clear()
        self._check()
        return self._ride(self._sweeps, 0, 0)

    @property
    def kept(self) -> int:
        """How many sweeps are kept so far."""
        return len(self._sweeps)

    def newest(self, count: int) -> Ride:
        """The ride of the newest ``count`` kept sweeps, with the readings around them. Without checks.

        Readings must be in order of their stamps to within ``_AROUND_S``.
        """
        sweeps = self._sweeps[-count:]
        since_s = sweeps[0].stamp_s - _AROUND_S if sweeps else math.inf
        return self._ride(sweeps, _begin(self._stamps, since_s), _begin(self._imu_stamps, since_s))

    def _ride(self, sweeps: Sequence[Sweep], odometry: int, imu: int) -> Ride:
        """The ride of ``sweeps``; odometry, imu: index of the first reading in their lists."""
        felt = np.asarray(self._imu[imu:], np.float64).reshape(-1, 3)
        stamps = self._imu_stamps[imu:]
        return Ride(
            tuple(sweeps),
            track(self._stamps[odometry:], self._odometry[odometry:]),
            track(stamps, [tuple(row) for row in felt[:, :2]]) if len(felt) else _nothing(2),
            track(stamps, [tuple(row) for row in felt[:, 2:]]) if len(felt) else _nothing(1),
        )

    def _check(self) -> None:
        s = self._settings
        if not self.sweeps:
            raise RideError("the recording contains no LiDAR sweep")
        if not self._odometry:
            raise RideError("the recording contains no odometry")
        if len(self._sweeps) < s.fewest:
            why = f"{self.sweeps} were recorded"
            if self.without_odometry:
                why += f", {self.without_odometry} of them without odometry"
            if self.empty:
                why += f", {self.empty} with fewer than {s.fewest_points} points"
            raise RideError(
                f"the ride is too short: {len(self._sweeps)} sweeps at places {s.step_m:g} m apart, "
                f"at least {s.fewest} are needed ({why})"
            )

    def _take(self, stamp_s: float, points: Points) -> None:
        s = self._settings
        recent = Track(np.array(self._stamps[-_RECENT:]), np.array(self._odometry[-_RECENT:]))
        if np.any(np.diff(recent.stamp_s) <= 0.0):
            recent = track(self._stamps[-_RECENT:], self._odometry[-_RECENT:])
        times = points["time"]
        begin_s = stamp_s + float(times.min(initial=0.0))
        if not math.isfinite(begin_s) or not recent.covers(begin_s, stamp_s, s.odometry_gap_s):
            self.without_odometry += 1
            return
        here = recent.at(np.array([stamp_s]))[0]
        if self._last is not None:
            step = np.abs(here - self._last)
            if math.hypot(step[0], step[1]) < s.step_m and step[2] < s.step_rad:
                return
        sweep = deskewed(points, stamp_s, recent, self._robot, s.nearest_m, s.voxel_m)
        if len(sweep.points) < s.fewest_points:
            self.empty += 1
            return
        self._sweeps.append(sweep)
        self._last = here


def _begin(stamps_s: list[float], since_s: float) -> int:
    """Index of the first reading since ``since_s`` in ascending stamps."""
    begin = len(stamps_s)
    while begin and stamps_s[begin - 1] >= since_s:
        begin -= 1
    return begin


def _nothing(columns: int) -> Track:
    return Track(np.empty(0), np.empty((0, columns)))
