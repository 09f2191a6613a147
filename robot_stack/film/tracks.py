"""Poses over time, and the times of a film's frames."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import Pose2

Floats = NDArray[np.float64]


class Track:
    """Planar poses of an object at times in s, in order, interpolated linearly."""

    def __init__(self, samples: Sequence[tuple[float, Pose2]]) -> None:
        """Raises ValueError without samples."""
        if not samples:
            raise ValueError("a track needs a pose")
        ordered = sorted(samples, key=lambda item: item[0])
        self.times = np.array([time_s for time_s, _ in ordered])
        self._x = np.array([pose.x for _, pose in ordered])
        self._y = np.array([pose.y for _, pose in ordered])
        self._yaw = np.unwrap([pose.yaw for _, pose in ordered])

    def at(self, time_s: float) -> Pose2:
        """The pose at a time, clamped to the first and last sample."""
        x, y, yaw = (float(np.interp(time_s, self.times, values)) for values in (self._x, self._y, self._yaw))
        return Pose2(x, y, math.remainder(yaw, 2.0 * math.pi))

    def line(self, until_s: float) -> Floats:
        """(n, 2) positions until then, m."""
        seen = self.times <= until_s
        return np.stack([self._x[seen], self._y[seen]], axis=1)

    def motion_m(self, turning_m: float) -> Floats:
        """(n,) way since the first sample, m; a radian of turning counts as ``turning_m``."""
        steps = np.hypot(np.diff(self._x), np.diff(self._y)) + turning_m * np.abs(np.diff(self._yaw))
        return np.concatenate([[0.0], np.cumsum(steps)])


@dataclass(slots=True)
class Story:
    """A recorded ride. Times in s since the epoch, poses in map.

    joints: rad by name at times. attached: from that time on, whether the wheelchair is latched.
    others: poses of all other recorded objects by name: wheelchair, people, stations.
    plans: (n, 2) points, m, in force from then on. captions: text from then on.
    obstacles: (n, 2) points, m, seen at that time.
    """

    robot: Track
    joints: tuple[Floats, dict[str, Floats]] = field(default_factory=lambda: (np.empty(0), {}))
    attached: list[tuple[float, bool]] = field(default_factory=list)
    others: dict[str, Track] = field(default_factory=dict)
    plans: list[tuple[float, Floats]] = field(default_factory=list)
    captions: list[tuple[float, str]] = field(default_factory=list)
    obstacles: list[tuple[float, Floats]] = field(default_factory=list)

    def joints_at(self, time_s: float) -> dict[str, float]:
        times, angles = self.joints
        return {name: float(np.interp(time_s, times, values)) for name, values in angles.items()} if len(times) else {}


def newest(items: Sequence[tuple[float, Any]], time_s: float, otherwise: Any) -> Any:
    """The value of the last item that is not later."""
    times = [item[0] for item in items]
    index = int(np.searchsorted(times, time_s, side="right"))
    return items[index - 1][1] if index else otherwise


def carried(robot: Track, attached: Sequence[tuple[float, bool]], chair_in_base: Pose2) -> Track | None:
    """Poses of an unrecorded wheelchair: at the latch while attached, else at rest."""
    samples: list[tuple[float, Pose2]] = []
    for index, (from_s, held) in enumerate(attached):
        if not held:
            continue
        until_s = attached[index + 1][0] if index + 1 < len(attached) else math.inf
        during = robot.times[(robot.times > from_s) & (robot.times < until_s)]
        ends = [from_s, *during.tolist(), *([until_s] if math.isfinite(until_s) else [])]
        samples += [(time_s, robot.at(time_s).compose(chair_in_base)) for time_s in ends]
    return Track(samples) if samples else None


def moments(robot: Track, count: int, standing_mps: float, turning_m: float) -> Floats:
    """(count,) times of a film's frames, s: equal motion between frames, where standing counts as
    ``standing_mps`` and a radian of turning as ``turning_m``.
    """
    times = robot.times - robot.times[0]
    course = robot.motion_m(turning_m) + standing_mps * times
    return np.asarray(robot.times[0] + np.interp(np.linspace(0.0, course[-1], count), course, times))
