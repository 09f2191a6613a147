"""Navigation among many people: a corridor of 3 m with people coming, and a hall that people cross."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import Footprint, Robot, load_robot
from robot_stack.navigation.params import NavigationParams
from robot_stack.navigation.warm_up import warm_up
from tests.benchmarks.navigation import configured, drive
from tests.benchmarks.support.framework import Aim, Result
from tests.benchmarks.support.navigation_course import LENGTH_M, WIDTH_M, Box, Course, Walker
from tests.benchmarks.support.navigation_picture import draw_courses
from tests.benchmarks.support.navigation_result import CourseResult

AIMS = {
    "corridor_success_pct": Aim(">", 95.0),
    "corridor_chair_success_pct": Aim(">", 95.0),
    "niches_success_pct": Aim(">", 95.0),
    "niches_chair_success_pct": Aim(">", 95.0),
    "hall_success_pct": Aim(">", 95.0),
    "hall_chair_success_pct": Aim(">", 95.0),
    "touched": Aim("<=", 0.0),
    "time_over_empty_p50": Aim("<", 2.5),
}
_MIDDLE_M, _CORRIDOR_M, _FROM_M, _TO_M = 8.0, 3.0, 5.0, 27.0
_COMING, _CROSSING = 8, 30
_NICHE_M = (2.5, 1.5)  # along, into the wall
_SPEEDS_MPS = (0.6, 1.4)
# A person whose way is blocked for some time walks sideways, away from the robot; every fourth waits instead.
_PATIENCE_S, _SIDEWAYS_MPS, _AT_WALL_M = 1.5, 0.4, 0.35
_WAITING = 4
_OUTSIDE = (-50.0, -50.0)


@dataclass
class Passer(Walker):
    """Enters at ``a`` after ``pause_s``, once the robot is 3 m away from there, walks to ``b`` and leaves.

    steps_aside: behaviour if the robot blocks the way.
    """

    steps_aside: bool = True
    inside: bool = False
    stands_s: float = 0.0

    def __post_init__(self) -> None:
        self.x, self.y = _OUTSIDE

    def step(self, dt_s: float, robot: Pose2, footprint: Footprint, random: np.random.Generator) -> None:
        if not self.inside:
            self.pause_s -= dt_s
            self.inside = self.pause_s <= 0.0 and math.hypot(robot.x - self.a[0], robot.y - self.a[1]) > 3.0
            if self.inside:
                self.x, self.y = self.a
        elif self.towards_b:
            before = self.x, self.y
            super().step(dt_s, robot, footprint, random)
            self.stands_s = self.stands_s + dt_s if (self.x, self.y) == before else 0.0
            if self.steps_aside and self.stands_s > _PATIENCE_S:
                self._step_aside(dt_s, robot)
        else:
            self.x, self.y = _OUTSIDE

    def _step_aside(self, dt_s: float, robot: Pose2) -> None:
        room_m = 0.5 * _CORRIDOR_M - _AT_WALL_M
        y = self.y + math.copysign(_SIDEWAYS_MPS * dt_s, self.y - robot.y)
        self.y = min(max(y, _MIDDLE_M - room_m), _MIDDLE_M + room_m)
        self.b = (self.b[0], self.y)


def corridor(seed: int, *, niches: bool, people: bool = True) -> Course:
    """A corridor of 22 m; ``niches`` on both sides of it give room to wait. Half of the people keep to one side."""
    random = np.random.default_rng(seed)
    low, high = _MIDDLE_M - _CORRIDOR_M / 2, _MIDDLE_M + _CORRIDOR_M / 2
    bounds = [_FROM_M, _TO_M]
    walls = _outer_walls()
    if niches:
        at_m = [float(random.uniform(9.0, 13.0)), float(random.uniform(18.0, 22.0))]
        bounds = [_FROM_M, *(edge for x in at_m for edge in (x - _NICHE_M[0] / 2, x + _NICHE_M[0] / 2)), _TO_M]
    for i, (begin, end) in enumerate(pairwise(bounds)):
        back_m = _NICHE_M[1] if i % 2 else 0.0
        half, bottom, top = 0.5 * (end - begin), low - back_m, WIDTH_M - high - back_m
        walls += [
            Box(begin + half, bottom / 2, half, bottom / 2, 0.0),
            Box(begin + half, WIDTH_M - top / 2, half, top / 2, 0.0),
        ]
    made = Course(Pose2(2.5, _MIDDLE_M, 0.0), Pose2(29.5, _MIDDLE_M, 0.0), walls)
    for k in range(_COMING if people else 0):
        ends = random.uniform(low + 0.4, high - 0.4, 2)
        if k % 2:
            ends[1] = ends[0]
        speed, enters = float(random.uniform(*_SPEEDS_MPS)), float(random.uniform(0.0, 30.0))
        a, b = (_TO_M + 0.3, float(ends[0])), (_FROM_M - 0.8, float(ends[1]))
        made.walkers.append(Passer(a, b, speed, pause_s=enters, steps_aside=k % _WAITING > 0))
    return made


def hall(seed: int, *, people: bool = True) -> Course:
    """A hall of 32 x 16 m that 30 people cross to and fro on straight lines of 5 to 14 m."""
    random = np.random.default_rng(seed)
    start = Pose2(2.5, float(random.uniform(4.0, 12.0)), 0.0)
    made = Course(start, Pose2(29.0, float(random.uniform(4.0, 12.0)), 0.0), _outer_walls())
    while people and len(made.walkers) < _CROSSING:
        a, b = random.uniform((1.0, 1.0), (LENGTH_M - 1.0, WIDTH_M - 1.0), (2, 2))
        line = np.linspace(a, b, 30)
        ends_m = min(float(np.hypot(*(line - (pose.x, pose.y)).T).min()) for pose in (made.start, made.goal))
        if 5.0 < float(np.hypot(*(b - a))) < 14.0 and ends_m > 2.0:
            speed = float(random.uniform(*_SPEEDS_MPS))
            made.walkers.append(Walker((float(a[0]), float(a[1])), (float(b[0]), float(b[1])), speed))
    return made


def _outer_walls() -> list[Box]:
    return [
        Box(LENGTH_M / 2, 0.1, LENGTH_M / 2, 0.1, 0.0),
        Box(LENGTH_M / 2, WIDTH_M - 0.1, LENGTH_M / 2, 0.1, 0.0),
        Box(0.1, WIDTH_M / 2, 0.1, WIDTH_M / 2, 0.0),
        Box(LENGTH_M - 0.1, WIDTH_M / 2, 0.1, WIDTH_M / 2, 0.0),
    ]


PLACES = {
    "corridor": lambda seed, people: corridor(seed, niches=False, people=people),
    "niches": lambda seed, people: corridor(seed, niches=True, people=people),
    "hall": lambda seed, people: hall(seed, people=people),
}


@dataclass(frozen=True, slots=True)
class Driven:
    """One ride. empty_s: the time of the same ride without people."""

    place: str
    seed: int
    chair: bool
    made: Course
    result: CourseResult
    empty_s: float


def ride(place: str, seed: int, params: NavigationParams, robot: Robot, *, chair: bool) -> Driven:
    """Returns one ride among people, compared with the same ride without them."""
    made = PLACES[place](seed, True)
    empty = drive(PLACES[place](seed, False), params, robot, seed, chair=chair)
    return Driven(place, seed, chair, made, drive(made, params, robot, seed, chair=chair), empty.time_s)


def run(runs: int = 50, first: int = 12001, pictures: str = "results") -> Result:
    """Returns (figures, conditions). runs: rides in each place, half of them with wheelchair and passenger, from seed
    ``first`` on. pictures: folder for the picture of the worst rides, empty for none.
    """
    params, robot = configured(), load_robot()
    warm_up()
    seeds = range(first, first + runs)
    driven = [ride(place, seed, params, robot, chair=seed % 2 == 0) for place in PLACES for seed in seeds]
    if pictures:
        draw_courses(
            [(f"{one.place} {one.seed}", one.made, one.chair, one.result) for one in driven],
            Path(pictures) / "crowd.png",
        )
    figures = {}
    for place in PLACES:
        for chair in (False, True):
            ends = [float(one.result.reached) for one in driven if one.place == place and one.chair == chair]
            figures[f"{place}{'_chair' if chair else ''}_success_pct"] = 100.0 * float(np.mean(ends or [math.nan]))
    slower = [one.result.time_s / one.empty_s for one in driven if one.result.reached]
    figures |= {
        "touched": float(sum(one.result.collisions for one in driven)),
        "person_m_min": min(one.result.person_m for one in driven),
        "time_over_empty_p50": float(np.median(slower or [math.nan])),
        "time_over_empty_max": max(slower, default=math.nan),
    }
    conditions: dict[str, object] = {
        "runs": f"seeds {first} to {first + runs - 1} in each place, even seeds with wheelchair and passenger",
        "corridor": f"{_CORRIDOR_M} m wide, {_TO_M - _FROM_M} m long, {_COMING} people come at {_SPEEDS_MPS} m/s "
        f"within 30 s; a person stops 0.6 m before the robot and steps aside after {_PATIENCE_S} s; every fourth waits",
        "niches": f"the same with room of {_NICHE_M[0]} x {_NICHE_M[1]} m on both sides at two places",
        "hall": f"{LENGTH_M:.0f} x {WIDTH_M:.0f} m, {_CROSSING} people cross it to and fro",
        "touched": "contacts while the robot moves; person_m_min: least distance to a person, driving",
        "failed": {f"{one.place} {one.seed}": one.result.text for one in driven if not one.result.reached},
        "peer": "none: Nav2 is not installed here",
    }
    return Result(figures, conditions)
