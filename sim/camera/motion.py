"""Timed poses of the robot and of the boards, interpolated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sim.plant.interpolation import interpolate

Array = NDArray[np.float64]
_UNMOVED = np.eye(4)


@dataclass(frozen=True, slots=True)
class Track:
    """Poses of one body in map. times_s: (n,) rising; poses: (n, 4, 4). Constant before the first, after the last."""

    times_s: Array
    poses: Array

    def __post_init__(self) -> None:
        if self.times_s.ndim != 1 or self.poses.shape != (len(self.times_s), 4, 4) or not len(self.times_s):
            raise ValueError(
                f"a track needs (n,) times and (n, 4, 4) poses, has {self.times_s.shape}, {self.poses.shape}"
            )
        if not (np.isfinite(self.times_s).all() and np.isfinite(self.poses).all()):
            raise ValueError("a track's times and poses must be finite")
        if (np.diff(self.times_s) <= 0.0).any():
            raise ValueError("a track's times must rise")

    def at(self, times_s: Array) -> Array:
        """(k, 4, 4) poses at (k,) rising times: positions linear, rotations by slerp."""
        if len(self.times_s) == 1:
            return np.broadcast_to(self.poses[0], (len(times_s), 4, 4))
        when = np.ascontiguousarray(times_s, dtype=np.float64)
        first = max(int(np.searchsorted(self.times_s, when[0], "right")) - 1, 0)
        last = int(np.searchsorted(self.times_s, when[-1], "left")) + 1
        place, turn = np.empty((len(when), 3)), np.empty((len(when), 3, 3))
        poses = np.ascontiguousarray(self.poses[first:last])
        interpolate(np.ascontiguousarray(self.times_s[first:last]), poses, when, _UNMOVED, place, turn)
        result = np.zeros((len(when), 4, 4))
        result[:, :3, :3], result[:, :3, 3], result[:, 3, 3] = turn, place, 1.0
        return result


def still(pose: Array) -> Track:
    """A body that does not move."""
    return Track(np.zeros(1), np.array(pose, dtype=float).reshape(1, 4, 4))


def checked_track(times_s: Array, poses: Array) -> Track:
    """A track of data already checked at reception: checking it again costs more than using it."""
    track = object.__new__(Track)
    object.__setattr__(track, "times_s", times_s)
    object.__setattr__(track, "poses", poses)
    return track


@dataclass(frozen=True, slots=True)
class Motion:
    """Motion during a picture.

    time_s: middle of the exposure of the middle row, on the tracks' clock.
    base: base_link in map. boards: the dock frame in map by dock id.
    """

    time_s: float
    base: Track
    boards: Mapping[str, Track] = field(default_factory=dict)

    @classmethod
    def still(cls, base: Array, boards: Mapping[str, Array]) -> Motion:
        """Nothing moves. base: (4, 4), boards: (4, 4) by dock id."""
        return cls(0.0, still(base), {name: still(pose) for name, pose in boards.items()})
