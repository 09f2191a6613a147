"""Removes the motion during a sweep: every point as if measured at the newest point's time."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.core.geometry import IDENTITY, Pose2, Twist2, exp_se2
from robot_stack.core.pose_history import LATE_S, PoseHistory
from robot_stack.perception.params import DeskewParams

Float = NDArray[np.float32]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Attitude:
    """Roll and pitch of base_link against gravity, rad (yaw, then pitch about y, then roll about x)."""

    roll_rad: float
    pitch_rad: float

    @staticmethod
    def of_tilt(tilt: tuple[float, float]) -> Attitude:
        """From the heights by which base_link's unit vectors x and y rise."""
        pitch = -math.asin(tilt[0])
        return Attitude(math.asin(tilt[1] / math.cos(pitch)), pitch)

    def matrix(self) -> Matrix:
        """(3, 3): base_link to its levelled frame (z against gravity, same heading)."""
        cr, sr = math.cos(self.roll_rad), math.sin(self.roll_rad)
        cp, sp = math.cos(self.pitch_rad), math.sin(self.pitch_rad)
        return np.array([[cp, sp * sr, sp * cr], [0.0, cr, -sr], [-sp, cp * sr, cp * cr]])


LEVEL = Attitude(0.0, 0.0)


class Motion:
    """Poses of base_link of the last second: odometry in the plane, roll and pitch from the inertial unit.

    restarts: number of times that the clock was set back; what was observed before has stamps of another clock.
    """

    def __init__(self, params: DeskewParams) -> None:
        self._params = params
        self._poses = PoseHistory(params.history_s)
        self._twist = Twist2(0.0, 0.0, 0.0)
        self._attitudes: deque[tuple[float, Attitude]] = deque()
        self.restarts = 0

    def on_odometry(self, stamp_s: float, pose: Pose2, twist: Twist2) -> str:
        """Adds a reading; returns the reason if it is rejected, else an empty text."""
        if not (math.isfinite(stamp_s) and pose.is_finite() and twist.is_finite()):
            return "/odom is not finite"
        if self._poses.is_set_back(stamp_s):
            self._poses.clear()
            self.restarts += 1
        if self._poses.add(stamp_s, pose):
            self._twist = twist
        return ""

    def on_attitude(self, stamp_s: float, attitude: Attitude) -> None:
        """Adds a reading that is newer than the newest; ignores one that is not finite or older."""
        if not all(map(math.isfinite, (stamp_s, attitude.roll_rad, attitude.pitch_rad))):
            return
        items = self._attitudes
        if items and items[-1][0] - stamp_s > LATE_S:
            items.clear()
        if not items or stamp_s > items[-1][0]:
            items.append((stamp_s, attitude))
        while items[-1][0] - items[0][0] > self._params.history_s:
            items.popleft()

    def problem(self, stamp_s: float) -> str:
        """Why the motion at ``stamp_s`` is unknown; empty if it is known."""
        newest = self._poses.newest
        if newest is None:
            return "no /odom yet"
        age_s = stamp_s - newest.stamp_s
        if age_s > self._params.odometry_silent_s:
            return f"/odom is {age_s:.2f} s older than the sweep, limit {self._params.odometry_silent_s} s"
        return ""

    def pose_at(self, stamp_s: float) -> Pose2:
        """base_link in odom; extrapolated by the newest twist. Needs a reading."""
        newest = self._poses.newest
        if newest is None:
            return IDENTITY
        if stamp_s >= newest.stamp_s:
            return newest.pose.compose(exp_se2(self._twist, stamp_s - newest.stamp_s))
        pose = self._poses.at(stamp_s)
        return newest.pose.compose(exp_se2(self._twist, stamp_s - newest.stamp_s)) if pose is None else pose

    def attitude_at(self, stamp_s: float) -> Attitude | None:
        """Interpolated; the newest holds for ``attitude_silent_s``. None if unknown."""
        items = self._attitudes
        if not items or abs(stamp_s - items[-1][0]) > max(self._params.attitude_silent_s, self._params.longest_s):
            return None
        if stamp_s >= items[-1][0]:
            return items[-1][1] if stamp_s - items[-1][0] <= self._params.attitude_silent_s else None
        for (after_s, after), (before_s, before) in pairwise(reversed(items)):
            if before_s <= stamp_s:
                share = (stamp_s - before_s) / (after_s - before_s)
                return Attitude(
                    before.roll_rad + share * (after.roll_rad - before.roll_rad),
                    before.pitch_rad + share * (after.pitch_rad - before.pitch_rad),
                )
        return items[0][1]

    def steps(self, stamp_s: float, oldest_s: float) -> Float:
        """(k, 3, 4): base_link at stamp_s - i * step_s to base_link at ``stamp_s``, back to ``oldest_s`` <= 0."""
        count = max(2, math.ceil(-oldest_s / self._params.step_s - 1e-6) + 1)
        end, level = self.pose_at(stamp_s), self.attitude_at(stamp_s) or LEVEL
        rows = []
        for i in range(count):
            at_s = stamp_s - i * self._params.step_s
            step, attitude = self.pose_at(at_s).relative_to(end), self.attitude_at(at_s) or level
            rows.append((step.x, step.y, step.yaw, attitude.roll_rad, attitude.pitch_rad))
        return _matrices(np.array(rows), level)


def _matrices(rows: Matrix, level: Attitude) -> Float:
    """(k, 3, 4) of rows x m, y m, yaw, roll, pitch rad: by the attitude there, the turn in the plane, back to level."""
    (cy, cr, cp), (sy, sr, sp) = np.cos(rows[:, 2:].T), np.sin(rows[:, 2:].T)
    turned = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    found = np.zeros((len(rows), 3, 4), dtype=np.float32)
    found[:, :, :3] = np.einsum("ji,jkn->nik", level.matrix(), turned)
    found[:, :2, 3] = rows[:, :2]  # the wheels roll in the robot's own plane
    return found


def deskew(xyz: Float, times: Float, steps: Float, step_s: float, out: Float | None = None) -> Float:
    """(m, 3) in base_link at the stamp.

    xyz: (m, 3) in base_link at each point's moment; times: (m,) s relative to the stamp, <= 0; steps: as
    ``Motion.steps`` gives, ``step_s`` apart. Between steps the matrices are interpolated; older points take the oldest.
    out: where to write, perhaps xyz itself; None: a new array.
    """
    moved = np.empty_like(xyz) if out is None else out
    _deskew(xyz, times, steps, np.float32(step_s), moved)
    return moved


@compiled
def _deskew(xyz: Float, times: Float, steps: Float, step_s: Any, moved: Float) -> None:
    last = len(steps) - 1
    matrix, known_s = np.empty((3, 4), np.float32), np.float32(np.nan)
    for i in range(len(xyz)):
        if times[i] != known_s:  # the points of a column are consecutive and have one time
            known_s = times[i]
            at = min(max(-known_s / step_s, np.float32(0.0)), np.float32(last))
            k = min(int(at), last - 1)
            share = at - np.float32(k)
            for row in range(3):
                for column in range(4):
                    near = steps[k, row, column]
                    matrix[row, column] = near + share * (steps[k + 1, row, column] - near)
        x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        for row in range(3):
            moved[i, row] = matrix[row, 0] * x + matrix[row, 1] * y + matrix[row, 2] * z + matrix[row, 3]
