"""People: moving bodies, and clusters of a person's size in the grid of the space, followed while they are seen.

Whether an object moves, and how fast, is decided by ``MovingObjects`` alone. Here its bodies get an identity and an
extent, and are continued where they stop: who has walked remains a person while something returns from there, or, where
no ray passes, while the grid keeps it. A body that approaches leaves cells in its own shadow, which no ray frees: what
does not return is no part of a cluster.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from robot_stack.core.people import Person
from robot_stack.perception.params import PeopleParams
from robot_stack.perception.space.kernels import OCCUPIED
from robot_stack.perception.space.moving_objects import MovingBody
from robot_stack.perception.space.space import SpaceGrid

Floats = NDArray[np.float64]
# Share of a cluster's cells at its people.
_EXPLAINED = 0.8
# Cells of a hidden person, at least; fewer returns there may be noise.
_CELLS = 4
# For so long a person who has arrived still counts as walking.
_ARRIVES_S = 1.5
_JOINED = np.ones((3, 3), np.int8)


@dataclass(frozen=True, slots=True)
class _Cells:
    """points: (n, 2) odom. age_s: (n,) since the last return. since_s: (n,) when they became occupied."""

    points: Floats
    age_s: Floats
    since_s: Floats


class People:
    """Nearest neighbour: grids arrive at 5 Hz, people are few and apart."""

    def __init__(self, params: PeopleParams) -> None:
        self._params = params
        self._number = 0
        self._walked_s: dict[int, float] = {}  # when each person has walked last, by number
        self.people: tuple[Person, ...] = ()

    def forget(self) -> None:
        self.people = ()

    def look(self, stamp_s: float, grid: SpaceGrid, bodies: Sequence[MovingBody]) -> tuple[Person, ...]:
        """Takes a grid and the moving bodies at its stamp, in odom. Returns the people, also ``self.people``.

        A stamp before the last one comes from a clock that was set back: all people are dropped.
        """
        if any(stamp_s < one.stamp_s for one in self.people):
            self.forget()
        small = self._apart(body for body in bodies if max(body.extent_m) <= self._params.max_size_m)
        large = self._apart(body for body in bodies if max(body.extent_m) > self._params.max_size_m)
        found = self._found(stamp_s, grid, [self._of_body(stamp_s, body) for body in small], large)
        matches = self._matched(found)
        now = [
            self._continued(self.people[matches[i]], seen) if i in matches else self._new(seen)
            for i, seen in enumerate(found)
        ]
        left = [one for k, one in enumerate(self.people) if k not in matches.values()]
        now += [
            one for one in left if stamp_s - one.stamp_s <= self._params.memory_s or self._is_hidden(grid, one, stamp_s)
        ]
        self.people = tuple(now)
        walked_s = {one.number: one.stamp_s for one in now if one.walks}
        self._walked_s = {one.number: self._walked_s.get(one.number, -math.inf) for one in now} | walked_s
        return self.people

    def _is_hidden(self, grid: SpaceGrid, one: Person, stamp_s: float) -> bool:
        """True if a person who has stopped gives no return, and the grid keeps the place because no ray passes it."""
        if not one.walked or one.box is None or one.walks:
            return False
        places = (np.array(one.box) - (*grid.corner_m, *grid.corner_m)) / grid.cell_m
        c0, r0, c1, r1 = (max(int(place), 0) for place in np.rint(places))
        kept = grid.state[r0:r1, c0:c1] == OCCUPIED
        returned = kept & (grid.hit_s[r0:r1, c0:c1] >= stamp_s - self._params.fresh_s)
        return int(np.count_nonzero(kept)) >= _CELLS > int(np.count_nonzero(returned))

    def _apart(self, bodies: Iterable[MovingBody]) -> list[MovingBody]:
        """Without those that another sensor tracks with less uncertainty."""
        kept: list[MovingBody] = []
        for body in sorted(bodies, key=lambda body: body.sigma_m):
            if all(math.hypot(body.x - one.x, body.y - one.y) > self._params.body_gate_m for one in kept):
                kept.append(body)
        return kept

    def _found(self, stamp_s: float, grid: SpaceGrid, walkers: list[Person], large: list[MovingBody]) -> list[Person]:
        """Returns the people in clusters of occupied cells, and the walkers that are in none that people explain.

        walkers: by the moving bodies of a person's size. large: moving bodies that are larger.
        """
        p, size_m = self._params, grid.cell_m
        occupied = (grid.state == OCCUPIED) & (grid.hit_s >= stamp_s - p.fresh_s)
        # A side seen at a flat angle breaks into pieces: cells nearer than a person's width are one object.
        joined = ndimage.binary_dilation(occupied, _JOINED, max(1, round(p.join_m / 2.0 / size_m)))
        labels, _ = ndimage.label(joined, structure=_JOINED)
        standing = [one for one in self.people if one.walked and stamp_s - one.apart_s <= p.group_s]
        together = self._together(stamp_s, standing, walkers, large)
        found: list[Person] = []
        alone = list(walkers)
        for index, window in enumerate(ndimage.find_objects(labels), start=1):
            rows, columns = np.nonzero((labels[window] == index) & occupied[window])
            points = np.column_stack((columns + window[1].start, rows + window[0].start)) + 0.5
            points = np.array(grid.corner_m) + size_m * points
            cells = _Cells(points, stamp_s - grid.hit_s[window][rows, columns], grid.since_s[window][rows, columns])
            moving, beside = (
                [one for one in some if float(_away(points, one, 0.0).min()) <= p.join_m] for some in (alone, together)
            )
            is_large = _size_m(points, size_m) > p.max_size_m
            people = list[Person]()
            if moving or beside or is_large:
                people = self._explaining(stamp_s, cells, size_m, moving, beside, standing)
            if people:
                alone = [one for one in alone if one not in moving]
                together = [one for one in together if one not in beside]
                found += people
            elif moving or is_large:
                found += self._beside_objects(stamp_s, cells, size_m, moving, standing)
            elif _size_m(points, size_m) >= p.min_size_m:
                found.append(self._seen(stamp_s, stamp_s, points, size_m))
        return found + alone

    def _together(
        self, stamp_s: float, standing: list[Person], walkers: list[Person], large: list[MovingBody]
    ) -> list[Person]:
        """Those of ``standing`` whom a larger moving body covers, with its velocity.

        The tracker of moving bodies sees walkers who come together as one body.
        """
        p, found = self._params, list[Person]()
        for one in standing:
            x, y = one.at(stamp_s)
            if any(math.hypot(x - other.x, y - other.y) <= p.body_gate_m for other in walkers):
                continue
            for body in large:
                dx, dy = abs(x - body.x) - 0.5 * body.extent_m[0], abs(y - body.y) - 0.5 * body.extent_m[1]
                if max(dx, dy) <= p.join_m:
                    walker = replace(self._of_body(stamp_s, body), x=x, y=y, radius_m=one.radius_m, number=one.number)
                    found.append(walker)
                    break
        return found

    def _explaining(
        self,
        stamp_s: float,
        cells: _Cells,
        size_m: float,
        moving: list[Person],
        together: list[Person],
        standing: list[Person],
    ) -> list[Person]:
        """People in a cluster of cells that together explain it; none if they do not.

        A person beside an object is not found in it, since the object would be taken for the person once that is gone.
        """
        p, points, walkers = self._params, cells.points, moving + together
        standing = [one for one in standing if not any(_is_at(one, other, stamp_s, p.gate_m) for other in walkers)]
        if not walkers and not standing:
            return []
        away_m = [_away(points, one, p.fresh_s) for one in walkers]
        away_m += [np.hypot(*(points - one.at(stamp_s)).T) for one in standing]
        nearest, near = np.argmin(away_m, axis=0), np.min(away_m, axis=0) <= p.max_radius_m
        if np.count_nonzero(near) < _EXPLAINED * len(points):
            return []
        found = list[Person]()
        for k, one in enumerate(walkers + standing):
            own = (nearest == k) & near
            piece = points[own]
            if len(piece) == 0 or _size_m(piece, size_m) < p.min_size_m:
                continue
            if k < len(moving):
                found.append(replace(one, apart_s=stamp_s, box=_box(piece, size_m)))
            elif k < len(walkers):
                # Each return is as old as the way that the person has gone since.
                x, y = (piece + cells.age_s[own, None] * (one.vx, one.vy)).mean(axis=0).tolist()
                found.append(replace(one, x=x, y=y, apart_s=stamp_s, box=_box(piece, size_m)))
            else:
                found.append(self._seen(stamp_s, one.apart_s, piece, size_m))
        return found

    def _beside_objects(
        self, stamp_s: float, cells: _Cells, size_m: float, moving: list[Person], standing: list[Person]
    ) -> list[Person]:
        """Those of ``standing`` in a cluster with an object: at their places, cells occupied since they came.

        The object's cells are older.
        """
        p, found = self._params, list[Person]()
        for one in standing:
            came_s = self._walked_s.get(one.number, math.inf) - _ARRIVES_S
            near = np.hypot(*(cells.points - (one.x, one.y)).T) <= p.max_radius_m
            own = cells.points[near & (cells.since_s >= came_s)]
            walks_on = any(_is_at(one, walker, stamp_s, p.gate_m) for walker in moving)
            if not walks_on and len(own) >= _CELLS and p.min_size_m <= _size_m(own, size_m) <= p.max_size_m:
                found.append(self._seen(stamp_s, stamp_s, own, size_m))
        return found

    def _seen(self, stamp_s: float, apart_s: float, points: Floats, size_m: float) -> Person:
        x, y = (float(value) for value in points.mean(axis=0))
        x0, y0, x1, y1 = box = _box(points, size_m)
        radius_m = self._radius_m(math.hypot(x1 - x0, y1 - y0))
        return Person(stamp_s, x, y, radius_m=radius_m, box=box, sigma_m=size_m, apart_s=apart_s)

    def _of_body(self, stamp_s: float, body: MovingBody) -> Person:
        radius_m = self._radius_m(math.hypot(*body.extent_m))
        return Person(
            *(stamp_s, body.x, body.y, body.vx, body.vy, radius_m, None, body.sigma_m, body.sigma_mps),
            walks=True,
            walked=True,
        )

    def _radius_m(self, diagonal_m: float) -> float:
        return min(max(self._params.min_radius_m, 0.4 * diagonal_m), self._params.max_radius_m)

    def _matched(self, found: list[Person]) -> dict[int, int]:
        """Person index by index of ``found``: nearest pairs first, each used once."""
        pairs = []
        for i, seen in enumerate(found):
            for k, one in enumerate(self.people):
                x, y = one.at(seen.stamp_s)
                distance_m = min(math.hypot(seen.x - x, seen.y - y), math.hypot(seen.x - one.x, seen.y - one.y))
                if distance_m < self._params.gate_m:
                    pairs.append((distance_m, i, k))
        matches: dict[int, int] = {}
        for _, i, k in sorted(pairs):
            if i not in matches and k not in matches.values():
                matches[i] = k
        return matches

    def _new(self, seen: Person) -> Person:
        self._number += 1
        return replace(seen, number=self._number)

    def _continued(self, before: Person, seen: Person) -> Person:
        # A walker who comes to an object remains one to plan with. What has only been seen to move at an object may be
        # a piece of it, seen through a gap.
        comes = seen.walks and before.walked and not before.in_group
        one = replace(
            seen,
            number=before.number,
            sightings=before.sightings + 1,
            walked=seen.walks or before.walked,
            apart_s=seen.stamp_s if comes else max(before.apart_s, seen.apart_s),
        )
        if seen.walks or before.walks:
            return one
        gain = self._params.position_gain
        return replace(one, x=before.x + gain * (seen.x - before.x), y=before.y + gain * (seen.y - before.y))


def _is_at(one: Person, walker: Person, stamp_s: float, gate_m: float) -> bool:
    x, y = one.at(stamp_s)
    return min(math.hypot(x - walker.x, y - walker.y), math.hypot(one.x - walker.x, one.y - walker.y)) < gate_m


def _away(points: Floats, walker: Person, trail_s: float) -> Floats:
    """(n,) distance of (n, 2) points from the way of a walker in the last ``trail_s``."""
    back = -trail_s * np.array((walker.vx, walker.vy))
    on = points - (walker.x, walker.y)
    share = np.clip(on @ back / max(float(back @ back), 1e-9), 0.0, 1.0)
    return np.asarray(np.hypot(*(on - share[:, None] * back).T))


def _box(points: Floats, size_m: float) -> tuple[float, float, float, float]:
    """Least x, y and greatest x, y of cells of ``size_m`` at (n, 2) points."""
    (x0, y0), (x1, y1) = points.min(axis=0) - 0.5 * size_m, points.max(axis=0) + 0.5 * size_m
    return float(x0), float(y0), float(x1), float(y1)


def _size_m(points: Floats, size_m: float) -> float:
    """Metres of the longer side of cells at (n, 2) points."""
    return float(np.ptp(points, axis=0).max()) + size_m
