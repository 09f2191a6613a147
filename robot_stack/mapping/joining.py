"""Several rides of one site in one frame: where a ride meets those before it, and how well the walls of both agree.

Single sweeps of a ride are searched in the map of the rides before it. One place found proves little, since places look
alike: several of the ride must agree on where all of it is, and clearly more than on any other way to place it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robot_stack.core.site_map import Cells
from robot_stack.mapping.cells import CellAccumulator
from robot_stack.mapping.course import Course, Progress, closed, ticks
from robot_stack.mapping.params import Joining as Settings
from robot_stack.mapping.params import MappingParams
from robot_stack.mapping.pose_graph import Edges
from robot_stack.mapping.poses import Floats, difference, inverse, transform
from robot_stack.mapping.refinement import spread
from robot_stack.mapping.ride import RideError

# ((n, 3) points in base_link, (3,) vertical in base_link) -> (4, 4) poses in the map that fit.
Finder = Callable[[Floats, Floats], Sequence[Floats]]
Recognition = Callable[[Cells], Finder]

_CELL_POINTS = 6
_UPRIGHT = 0.5  # largest vertical part of a wall's normal
_ROBUST = 3.0


@dataclass(frozen=True, slots=True)
class Overlap:
    """Of a ride with those before it: loops between them, walls (cells) that both saw, root mean square of the distance
    between both across the wall; NaN without one.
    """

    loops: int
    walls: int
    rms_m: float


@dataclass(frozen=True, slots=True)
class _Sightings:
    """Places of a ride found in the map: sweep (n,), pose in the map (n, 4, 4). searches: how many were tried."""

    sweep: np.ndarray
    pose: Floats
    searches: int


def joined(
    courses: Mapping[str, Course], start: Floats, params: MappingParams, recognition: Recognition, progress: Progress
) -> tuple[Course, list[str]]:
    """(all rides in the frame of the first, their names in the order of joining). Raises RideError with the names of
    those that are not connected.

    courses: by the names of their recordings, each in a frame of its own, loops closed.
    """
    names = list(courses)
    order, waiting = names[:1], names[1:]
    whole = courses[names[0]]
    while waiting:
        find = recognition(_map_of(whole, params))
        refusals: list[str] = []
        for name in waiting:
            course = courses[name]
            seen = _sightings(course, find, params.joining, progress, name)
            best, refusal = _agreeing(course, seen, params.joining)
            if not refusal:
                break
            refusals.append(f"{name} ({refusal})")
        else:
            raise RideError(f"not connected with {' and '.join(order)}: {', '.join(refusals)}")
        waiting.remove(name)
        whole = closed(whole.followed_by(_placed(course, seen, best, params)), start, params, progress)
        if not any(whole.ride[loop.earlier] < len(order) <= whole.ride[loop.later] for loop in whole.loops):
            raise RideError(f"not connected with {' and '.join(order)}: {name} (places recognised, but no loop fits)")
        order.append(name)
    return whole, order


def _map_of(course: Course, params: MappingParams) -> Cells:
    s = params.joining
    accumulator = CellAccumulator(params.cells.size_m)
    for points, pose in zip(course.sweeps, course.poses, strict=True):
        accumulator.add(transform(pose, spread(points, 0.5 * s.point_m, s.range_m)))
    return accumulator.cells(_CELL_POINTS)


def _sightings(course: Course, find: Finder, settings: Settings, progress: Progress, name: str) -> _Sightings:
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(course.poses[:, :3, 3], axis=0), axis=1))])
    chosen = np.unique(np.searchsorted(way, np.arange(0.0, way[-1] + 1e-9, settings.every_m)))
    tick = ticks(progress, f"searching {name}", len(chosen))
    sweep: list[int] = []
    poses: list[Floats] = []
    for k in chosen.tolist():
        found = find(spread(course.sweeps[k], settings.point_m, settings.range_m), course.poses[k, 2, :3].copy())
        sweep += [k] * len(found)
        poses += found
        tick()
    return _Sightings(np.array(sweep, np.int64), np.array(poses).reshape(-1, 4, 4), len(chosen))


def _agreeing(course: Course, seen: _Sightings, settings: Settings) -> tuple[np.ndarray, str]:
    """((n,) True for the sightings that place the ride alike, "" or why the ride cannot be placed)."""
    frames = seen.pose @ inverse(course.poses[seen.sweep])
    best = np.zeros(len(frames), bool)
    votes: list[tuple[int, np.ndarray]] = []
    for frame in frames:
        off = difference(frame @ course.poses[seen.sweep], seen.pose)
        alike = (np.linalg.norm(off[:, :2], axis=1) < settings.agree_m) & (np.abs(off[:, 5]) < settings.agree_rad)
        votes.append((len(np.unique(seen.sweep[alike])), alike))
    count, best = max(votes, key=lambda vote: vote[0], default=(0, best))
    found = len(np.unique(seen.sweep))
    if count < settings.fewest:
        return best, f"{found} of {seen.searches} places recognised, {count} of them agree, {settings.fewest} must"
    # The same place of the ride may be found twice: only ways that share no sighting are rivals.
    rival = max((other for other, alike in votes if not (alike & best).any()), default=0)
    if rival > settings.rival_share * count:
        return best, f"{count} places fit in one place, {rival} in another: the site looks alike there"
    return best, ""


def _placed(course: Course, seen: _Sightings, used: np.ndarray, params: MappingParams) -> Course:
    """The ride bent so that the used sightings agree best."""
    s, sweep, pose = params.joining, seen.sweep[used], seen.pose[used]
    middle = len(sweep) // 2
    frame = pose[middle] @ inverse(course.poses[sweep[middle]])
    weight = np.tile([1.0 / s.deviation_m] * 3 + [1.0 / s.deviation_rad] * 3, (len(sweep), 1))
    edges = Edges(np.full(len(sweep), -1), sweep, pose, weight, _ROBUST)
    return replace(course, poses=frame @ course.poses).solved(None, params, [edges])


def overlap(course: Course, number: int, params: MappingParams) -> Overlap:
    """Of ride ``number``, from 1."""
    loops = sum(course.ride[loop.earlier] < number == course.ride[loop.later] for loop in course.loops)
    newer = _cells(course, np.flatnonzero(course.ride == number), params)
    older = _cells(course, np.flatnonzero(course.ride < number), params)
    place = {tuple(key): row for row, key in enumerate(older.key.tolist())}
    pairs = [(row, place[tuple(key)]) for row, key in enumerate(newer.key.tolist()) if tuple(key) in place]
    if not pairs:
        return Overlap(loops, 0, math.nan)
    new, old = np.array(pairs).T
    spread2, axes = np.linalg.eigh(older.covariance[old])
    thin = params.joining.flat_m**2
    wall = (spread2[:, 0] < thin) & (spread2[:, 1] > thin) & (np.abs(axes[:, 2, 0]) < _UPRIGHT)
    wall &= np.linalg.eigvalsh(newer.covariance[new])[:, 0] < thin
    across = np.einsum("ni,ni->n", axes[:, :, 0], newer.mean[new] - older.mean[old])[wall]
    rms_m = float(np.sqrt((across**2).mean())) if len(across) else math.nan
    return Overlap(int(loops), len(across), rms_m)


def _cells(course: Course, chosen: np.ndarray, params: MappingParams) -> Cells:
    s = params.refinement
    accumulator = CellAccumulator(s.voxels_m[-1])
    for i in chosen.tolist():
        near = course.sweeps[i][(course.sweeps[i] ** 2).sum(axis=1) < s.range_m**2]
        accumulator.add(transform(course.poses[i], near))
    return accumulator.cells(s.cell_points)
