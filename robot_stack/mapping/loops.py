"""Loop closure: places visited again, measured by registration of one visit's sweeps to the other's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robot_stack.mapping.cells import cells_of
from robot_stack.mapping.params import Loops as Settings
from robot_stack.mapping.pose_graph import Indices
from robot_stack.mapping.poses import Floats, inverse, transform
from robot_stack.mapping.registration import Target, align, target_of

_CELL_POINTS = 6
_MOST_POINTS = 8000


@dataclass(frozen=True, slots=True)
class Loop:
    """measured: (4, 4) pose of sweep ``later`` in the frame of sweep ``earlier``; share: of its points that fit."""

    earlier: int
    later: int
    measured: Floats
    share: float


def candidates(poses: Floats, stamps_s: Floats, ride: Indices, settings: Settings) -> list[tuple[int, int]]:
    """(earlier, later) pairs to try: near in space, far apart in time, one search per ``every_m`` of the path.

    ride: (n,) number of each pose's ride, rising. If there are several, the last one is paired with those before it,
    which the poses place in one frame.
    """
    places = poses[:, :2, 3]
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
    several = bool(ride[-1])
    found, searched_m = [], -np.inf
    for later in np.flatnonzero(ride == ride[-1]).tolist():
        # The end of the ride closes its largest loop.
        if way[later] - searched_m < settings.every_m and later != len(poses) - 1:
            continue
        old = ride < ride[-1] if several else stamps_s < stamps_s[later] - settings.time_apart_s
        before = np.flatnonzero(old)
        if not len(before):
            continue
        apart = np.linalg.norm(places[before] - places[later], axis=1)
        drift_m = 0.0 if several else settings.drift_share * (way[later] - way[before])
        allowed = settings.radius_m + drift_m
        excess = apart - allowed
        best = int(np.argmin(excess))
        if excess[best] < 0.0:
            found.append((int(before[int(np.argmin(np.where(excess < 0.0, apart, np.inf)))]), later))
            searched_m = way[later]
    return found


def close_loops(
    sweeps: Sequence[Floats],
    poses: Floats,
    ride: Indices,
    pairs: Sequence[tuple[int, int]],
    settings: Settings,
    tick: Callable[[], None],
) -> list[Loop]:
    """The pairs that fit, measured.

    sweeps: (n, 3) points in base_link each; poses: the best estimate so far; ride: (n,) number of each one's ride.
    """
    loops = []
    for earlier, later in pairs:
        targets = _place(sweeps, poses, ride, earlier, settings)
        points = _around(sweeps, poses, ride, later, settings.window // 2)
        points = points[:: max(1, len(points) // _MOST_POINTS)]
        result = align(points, targets, inverse(poses[earlier]) @ poses[later], most_iterations=30)
        if result.share >= settings.fewest_share:
            loops.append(Loop(earlier, later, result.pose, result.share))
        tick()
    return loops


def _place(sweeps: Sequence[Floats], poses: Floats, ride: Indices, index: int, settings: Settings) -> list[Target]:
    points = _around(sweeps, poses, ride, index, settings.window)
    return [target_of(cells_of(points, size_m, _CELL_POINTS)) for size_m in settings.voxels_m]


def _around(sweeps: Sequence[Floats], poses: Floats, ride: Indices, index: int, window: int) -> Floats:
    """Points of the sweeps about ``index`` of its ride, in its frame."""
    about = range(max(0, index - window), min(len(sweeps), index + window + 1))
    near = [i for i in about if ride[i] == ride[index]]
    back = inverse(poses[index])
    return np.concatenate([transform(back @ poses[i], sweeps[i]) for i in near])
