"""The last poses of the bodies of the world, and the picture that is due."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from sim.camera.motion import Motion, Track, checked_track

Array = NDArray[np.float64]
_KEEP = 24  # samples: half a second at 50 Hz
BASE = "base_link"


class BodyHistory:
    """Timed poses by body name; all bodies of one sample share its time."""

    def __init__(self) -> None:
        self._times: deque[float] = deque(maxlen=_KEEP)
        self._names: tuple[str, ...] = ()
        self._poses: deque[Array] = deque(maxlen=_KEEP)  # (bodies, 4, 4) each

    @property
    def newest_s(self) -> float | None:
        return self._times[-1] if self._times else None

    def add(self, time_s: float, poses: Mapping[str, Array]) -> None:
        """One sample, (4, 4) poses in map. A time that steps back, or a change of bodies, begins a new history.

        Raises ValueError for poses that are not finite.
        """
        newest = self.newest_s
        if newest is not None and time_s == newest:
            return
        if (newest is not None and time_s < newest) or poses.keys() != set(self._names):
            self._times.clear()
            self._poses.clear()
            self._names = tuple(poses)
        sample = np.array([poses[name] for name in self._names])
        if not np.isfinite(sample).all():
            raise ValueError(f"poses must be finite, at {time_s}")
        self._times.append(time_s)
        self._poses.append(sample)

    def covers(self, from_s: float, to_s: float) -> bool:
        return len(self._times) >= 2 and self._times[0] <= from_s and to_s <= self._times[-1]

    def tracks(self) -> dict[str, Track]:
        """The stored tracks, by body name."""
        times, poses = np.array(self._times), np.array(self._poses)
        return {name: checked_track(times, poses[:, index]) for index, name in enumerate(self._names)}

    def motion(self, time_s: float, docks: dict[str, str]) -> Motion:
        """The motion around a picture. docks: dock id by body name. Raises KeyError without base_link."""
        tracks = self.tracks()
        boards = {docks[name]: track for name, track in tracks.items() if name in docks}
        return Motion(time_s, tracks[BASE], boards)


class ExposurePlan:
    """Exposures at phase + k period on the clock: no drift, and a missed one is not made up for."""

    def __init__(self, period_s: float, phase_s: float, margin_s: float) -> None:
        self._period_s, self._phase_s, self._margin_s = period_s, phase_s, margin_s
        self._last: int | None = None

    def due(self, history: BodyHistory) -> float | None:
        """The newest exposure whose rows the history covers, once; None if there is none yet."""
        newest = history.newest_s
        if newest is None:
            return None
        index = int(np.floor((newest - self._margin_s - self._phase_s) / self._period_s))
        if self._last is not None and index < self._last - 1:
            self._last = None  # the clock was set back
        if self._last is not None and index <= self._last:
            return None
        time_s = self._phase_s + index * self._period_s
        if not history.covers(time_s - self._margin_s, time_s + self._margin_s):
            return None
        self._last = index
        return time_s
