"""Parts of a turn at their completion, from the bodies' poses at their arrival; with ROS or without."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.point_cloud import Points
from sim.camera.history import BASE, BodyHistory
from sim.camera.motion import Track
from sim.lidar.sensor import CLEAR, Conditions, Lidar, Sweep

F64 = NDArray[np.float64]
# Stamps of poses are what a clock makes of them.
_TOLERANCE_S = 2e-4


Tracks = Mapping[str, Track]
"""Motion of bodies, by name."""


class Sweeper:
    """Parts of a turn, halves by default, at equal intervals, counted from the first sample on.

    Multiples of ``parts`` complete a turn. Poses every 20 ms complete a half sweep at once or 10 ms later.
    """

    def __init__(self, lidar: Lidar, parts: int = 2) -> None:
        self.lidar, self._parts = lidar, parts
        self._history = BodyHistory()
        self._part_s = lidar.params.beams.period_s / parts
        self._phase_s: float | None = None
        self._next = 1

    def add(self, time_s: float, poses: Mapping[str, F64]) -> None:
        """(4, 4) poses of all bodies in map at one time. A time that steps back restarts. Raises KeyError."""
        if BASE not in poses:
            raise KeyError(BASE)
        newest = self._history.newest_s
        if self._phase_s is None or (newest is not None and time_s < newest):
            self._phase_s, self._next = time_s, 1
        self._history.add(time_s, dict(poses))

    def due(self) -> tuple[int, float] | None:
        """The next part whose end the poses have reached: its number and the time of its last column.

        After a gap the newest one: missed parts are lost.
        """
        newest = self._history.newest_s
        if newest is None or self._phase_s is None:
            return None
        last = math.floor((newest + _TOLERANCE_S - self._phase_s) / self._part_s)
        if last < self._next:
            return None
        number = last if last > self._next + 1 else self._next
        self._next = number + 1
        end_s = self._phase_s + number * self._part_s
        return (number, end_s) if self._history.covers(end_s - self._part_s, end_s - _TOLERANCE_S) else None

    def tracks(self) -> Tracks:
        """Motion of the bodies so far; ``measure`` may use it in another thread."""
        return self._history.tracks()

    def measure(
        self, tracks: Tracks, number: int, end_s: float, conditions: Conditions = CLEAR, out: Points | None = None
    ) -> Sweep:
        """Part ``number``. out: memory for its points, room for every beam. One call at a time."""
        others = {name: track for name, track in tracks.items() if name != BASE}
        share = (number - 1) % self._parts, self._parts
        return self.lidar.share(tracks[BASE], end_s, share, others, conditions, out)
