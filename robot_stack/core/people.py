"""People around the robot, as perception tracks them and navigation plans with them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from robot_stack.core.point_cloud import PEOPLE, Points


@dataclass(frozen=True, slots=True)
class Person:
    """An object of a person's size, in odom. x, y: m at stamp_s, the time of its last detection. vx, vy: m/s.

    number: of the track. radius_m: of a circle in its place. box: least x, y and greatest x, y of its cells at stamp_s,
    None without cells of its own. sigma_m, sigma_mps: standard deviations of place and velocity along each axis.
    sightings: grids with a detection. walks: a moving body. walked: has walked, so this is a person and not an
    object of that size. apart_s: the last stamp at which nothing else touched the person, or at which a walker
    touched an object without having been in a group before.
    """

    stamp_s: float
    x: float
    y: float
    vx: float = 0.0
    vy: float = 0.0
    radius_m: float = 0.3
    box: tuple[float, float, float, float] | None = None
    sigma_m: float = 0.0
    sigma_mps: float = 0.0
    sightings: int = 1
    walks: bool = False
    walked: bool = False
    apart_s: float = -math.inf
    number: int = 0

    @property
    def in_group(self) -> bool:
        """Nothing separates the person from others who stand, or from an object."""
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
    """Those seen in at least ``sightings`` grids."""
    return [person for person in people if person.sightings >= sightings]


def people_points(people: Iterable[Person], stamp_s: float) -> Points:
    """(n,) of ``PEOPLE`` at the stamp of a cloud."""
    rows = [
        (
            *(one.x, one.y, 0.0, one.vx, one.vy, one.radius_m, one.sigma_m, one.sigma_mps),
            *(stamp_s - one.stamp_s, stamp_s - one.apart_s),
            *((math.nan,) * 4 if one.box is None else one.box),
            *(one.number, one.sightings, one.walks, one.walked),
        )
        for one in people
    ]
    return np.array(rows, PEOPLE)


def people_of(points: Points, stamp_s: float) -> tuple[Person, ...]:
    """The people of (n,) of ``PEOPLE`` with the stamp of their cloud; ValueError for values that are not finite."""
    people = []
    for x, y, _, vx, vy, radius, sigma, sigma_v, age, apart, *box, number, sightings, walks, walked in points.tolist():
        if not all(map(math.isfinite, (x, y, vx, vy, radius, age))):
            raise ValueError(f"person {number} has values that are not finite")
        corners = (box[0], box[1], box[2], box[3]) if all(map(math.isfinite, box)) else None
        people.append(
            Person(
                *(stamp_s - age, x, y, vx, vy, radius, corners, sigma, sigma_v, sightings),
                *(bool(walks), bool(walked), stamp_s - apart, number),
            )
        )
    return tuple(people)
