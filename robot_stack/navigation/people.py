"""People in the costmap: person-sized clusters of lethal cells absent from the map, tracked over the costmaps."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from robot_stack.navigation.params import PeopleParams

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.int64]
# Share of a group's cells at its people.
_GROUP_SHARE = 0.8
_JOINED = np.ones((3, 3), np.int8)


@dataclass(frozen=True, slots=True)
class Person:
    """In the costmap's frame. x, y: m at stamp_s. vx, vy: m/s. sightings: costmaps with a detection.

    walks: walking now. walked: has walked, so this is a person and not an object of that size. apart_s: the last
    stamp at which nothing else touched the person.
    """

    stamp_s: float
    x: float
    y: float
    vx: float = 0.0
    vy: float = 0.0
    radius_m: float = 0.3
    sightings: int = 1
    first: tuple[float, float] = (0.0, 0.0)
    walks: bool = False
    walked: bool = False
    apart_s: float = -math.inf

    @property
    def in_group(self) -> bool:
        """Nothing separates the person from others."""
        return self.stamp_s > self.apart_s

    @property
    def velocity(self) -> tuple[float, float]:
        """m/s; zero unless walking."""
        return (self.vx, self.vy) if self.walks else (0.0, 0.0)

    def at(self, time_s: float) -> tuple[float, float]:
        """Predicted position; the last one unless walking."""
        ahead_s = time_s - self.stamp_s if self.walks else 0.0
        return self.x + ahead_s * self.vx, self.y + ahead_s * self.vy


def confirmed(people: Iterable[Person], sightings: int) -> list[Person]:
    """Those seen in at least ``sightings`` costmaps."""
    return [person for person in people if person.sightings >= sightings]


class PeopleTracker:
    """Nearest neighbour and an alpha-beta filter: costmaps arrive at 5 Hz, people are few and apart."""

    def __init__(self, params: PeopleParams) -> None:
        self._params = params
        self.people: tuple[Person, ...] = ()

    def clear(self) -> None:
        self.people = ()

    def update(self, stamp_s: float, lethal: Mask, known: Mask, resolution_m: float, x_m: float, y_m: float) -> Mask:
        """Takes a costmap's lethal cells; known: those of map obstacles. Returns the cells of walking people."""
        # A side seen at a flat angle breaks into pieces: cells nearer than a person's width are one object.
        joined = ndimage.binary_dilation(lethal, _JOINED, max(1, round(self._params.join_m / 2.0 / resolution_m)))
        labels, _ = ndimage.label(joined, structure=_JOINED)
        walking = np.zeros_like(lethal)
        found: list[tuple[Person, tuple[Indices, Indices]]] = []
        for index, window in enumerate(ndimage.find_objects(labels), start=1):
            cluster = (labels[window] == index) & lethal[window]
            if np.count_nonzero(cluster & known[window]) > 0.5 * np.count_nonzero(cluster):
                continue
            rows, columns = np.nonzero(cluster)
            rows, columns = rows + window[0].start, columns + window[1].start
            x, y = x_m + (columns + 0.5) * resolution_m, y_m + (rows + 0.5) * resolution_m
            for seen, piece in self._persons(stamp_s, x, y, resolution_m):
                found.append((seen, (rows[piece], columns[piece])))
        matches = self._matched([seen for seen, *_ in found])
        now: list[Person] = []
        for i, (seen, cells) in enumerate(found):
            person = self._filtered(self.people[matches[i]], seen) if i in matches else seen
            now.append(person)
            if person.walks and not person.in_group:
                walking[cells] = True
        # A briefly occluded track continues.
        left = [person for k, person in enumerate(self.people) if k not in matches.values()]
        now += [person for person in left if stamp_s - person.stamp_s <= self._params.memory_s]
        self.people = tuple(now)
        return walking

    def _persons(self, stamp_s: float, x: Array, y: Array, resolution_m: float) -> list[tuple[Person, Mask]]:
        """Returns (person, its cells) in a cluster of cells at (n,) x, y.

        A cluster of a person's size is one. A larger one is a group if those who were followed into it explain it: a
        person beside an object is not found in it, since the object would be taken for the person once that is gone.
        """
        p = self._params
        size_m = _size_m(x, y, resolution_m)
        if size_m <= p.max_size_m:
            whole = np.ones(len(x), np.bool_)
            return [(self._seen(stamp_s, stamp_s, x, y, resolution_m), whole)] if size_m >= p.min_size_m else []
        inside = [one for one in self.people if one.walked and stamp_s - one.apart_s <= p.group_s]
        if not inside:
            return []
        at = np.array([one.at(stamp_s) for one in inside])
        away_m = np.hypot(x[:, None] - at[:, 0], y[:, None] - at[:, 1])
        nearest, near = away_m.argmin(axis=1), away_m.min(axis=1) <= p.max_radius_m
        if np.count_nonzero(near) < _GROUP_SHARE * len(x):
            return []
        pieces = [(one, (nearest == k) & near) for k, one in enumerate(inside)]
        return [
            (self._seen(stamp_s, one.apart_s, x[piece], y[piece], resolution_m), piece)
            for one, piece in pieces
            if piece.any() and _size_m(x[piece], y[piece], resolution_m) >= p.min_size_m
        ]

    def _seen(self, stamp_s: float, apart_s: float, x: Array, y: Array, resolution_m: float) -> Person:
        p, at = self._params, (float(x.mean()), float(y.mean()))
        diagonal_m = math.hypot(float(np.ptp(x)) + resolution_m, float(np.ptp(y)) + resolution_m)
        radius_m = min(max(p.min_radius_m, 0.4 * diagonal_m), p.max_radius_m)
        return Person(stamp_s, *at, radius_m=radius_m, first=at, apart_s=apart_s)

    def _matched(self, found: list[Person]) -> dict[int, int]:
        """Person index by index of ``found``: nearest pairs first, each used once."""
        pairs = []
        for i, seen in enumerate(found):
            for k, person in enumerate(self.people):
                x, y = person.at(seen.stamp_s)
                distance_m = min(math.hypot(seen.x - x, seen.y - y), math.hypot(seen.x - person.x, seen.y - person.y))
                if distance_m < self._params.gate_m:
                    pairs.append((distance_m, i, k))
        matches: dict[int, int] = {}
        for _, i, k in sorted(pairs):
            if i not in matches and k not in matches.values():
                matches[i] = k
        return matches

    def _filtered(self, before: Person, seen: Person) -> Person:
        p, dt_s = self._params, seen.stamp_s - before.stamp_s
        if dt_s <= 0.0:
            return before
        x, y = before.x + dt_s * before.vx, before.y + dt_s * before.vy
        dx, dy = seen.x - x, seen.y - y
        gain = p.velocity_gain / dt_s
        vx, vy = before.vx + gain * dx, before.vy + gain * dy
        speed = math.hypot(vx, vy)
        if speed > p.max_speed_mps:
            vx, vy = vx * p.max_speed_mps / speed, vy * p.max_speed_mps / speed
        x, y = x + p.position_gain * dx, y + p.position_gain * dy
        sightings = before.sightings + 1
        far = math.hypot(x - before.first[0], y - before.first[1]) >= p.walked_m
        limit = p.walk_speed_mps * (0.6 if before.walks else 1.0)
        walks = sightings >= p.sightings and (far or before.walks) and speed >= limit
        # A person who has stopped must walk the full distance again to count as walking.
        first = before.first if walks or not before.walks else (x, y)
        walked = walks or before.walked
        return replace(seen, x=x, y=y, vx=vx, vy=vy, sightings=sightings, first=first, walks=walks, walked=walked)


def _size_m(x: Array, y: Array, resolution_m: float) -> float:
    """Metres of the longer side of cells at (n,) x, y."""
    return float(max(np.ptp(x), np.ptp(y))) + resolution_m
