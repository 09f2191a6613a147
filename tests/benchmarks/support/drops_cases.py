"""Drawn cases of the benchmark ``drops``: a drop in the robot's path, or a passable route."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import IDENTITY, Pose2, Twist2
from robot_stack.core.robot import load_robot
from sim.worldfile import Box, Pit, Ramp, WorldFile, load_world
from tests.benchmarks.support.people_senses import castors, chair_ahead

Direction = Literal["ahead", "behind", "aside", "turn"]
DIRECTIONS: tuple[Direction, ...] = ("ahead", "ahead", "behind", "aside", "turn")
DEPTHS_M = (0.05, 0.10, 0.15, 0.30, 0.50, 1.0, 3.0)
WIDTHS_M = (1.0, 3.0, 12.0)
# Each direction and depth occurs once with the chair and once without; the widths alternate.
ROUND = 2 * len(DIRECTIONS) * len(DEPTHS_M)
PASSABLE = ("ramp_up", "ramp_down", "ramp_over", "kerb_down", "level", "wall")
SETTLE_S = 1.0
_LENGTH_M = 4.0  # length of a drop in the driving direction
_TURN_AFTER_M = 3.5
_KERB_M = 0.03  # kerb height that the wheels can pass
_RAMP_DEG = (4.0, 10.0)


@dataclass(frozen=True, slots=True)
class Leg:
    """A command that holds until the robot has driven the given distance, m, or without limit."""

    requested: Twist2
    until_m: float


@dataclass(frozen=True, slots=True)
class Case:
    """legs: the successive commands. start: pose of base_link in map. what: a description.

    to_m: x at the end of a passable route; inf for a drop.
    """

    seed: int
    what: str
    chair: bool
    world: WorldFile
    start: Pose2
    legs: tuple[Leg, ...]
    run_s: float
    to_m: float = math.inf


def drop(number: int, seed: int) -> Case:
    """number: index of the combination within a round."""
    chair, rest = number % 2 == 0, number // 2
    depth, kind = rest // len(DIRECTIONS), rest % len(DIRECTIONS)
    depth_m, width_m = DEPTHS_M[depth % len(DEPTHS_M)], WIDTHS_M[(depth + kind + 2) % len(WIDTHS_M)]
    direction = DIRECTIONS[kind]
    random = np.random.default_rng(seed)
    most_mps = 1.0 if chair else 1.5
    speed_mps = random.choice([0.3, 0.6, 1.0]) * most_mps
    way = {"ahead": 0.0, "behind": math.pi, "aside": random.choice([-1.0, 1.0]) * 0.5 * math.pi, "turn": 0.0}[direction]
    legs: tuple[Leg, ...]
    if direction == "turn":
        side, aside_m = random.choice([-1.0, 1.0]), random.uniform(0.55, 0.9)
        front = Pose2(_TURN_AFTER_M, side * aside_m, side * 0.5 * math.pi)
        ahead = Leg(Twist2(min(speed_mps, 0.6), 0.0, 0.0), _TURN_AFTER_M)
        legs = (ahead, Leg(Twist2(random.choice([0.0, 0.3]), 0.0, side * random.uniform(0.3, 0.8)), math.inf))
        run_s, width_m = SETTLE_S + 3.0 + _TURN_AFTER_M / min(speed_mps, 0.6) + 8.0, max(width_m, 3.0)
    else:
        away_m = random.uniform(2.5, 4.5) + (1.4 if direction == "ahead" and chair else 0.4)
        aside_m = random.uniform(-0.15, 0.15) if width_m < 3.0 else random.uniform(-0.3, 0.3) * width_m
        tilt = random.uniform(-0.35, 0.35)
        middle = Pose2(0.0, 0.0, way).compose(Pose2(away_m, 0.0, tilt))
        front = middle.compose(Pose2(0.0, aside_m, 0.0))
        twist = Twist2(speed_mps * math.cos(way), speed_mps * math.sin(way), 0.0)
        legs, run_s = (Leg(twist, math.inf),), SETTLE_S + 3.0 + away_m / speed_mps + 3.0
    centre = front.compose(Pose2(0.5 * _LENGTH_M, 0.0, 0.0))
    pit = Pit(
        name="drop",
        x_m=centre.x,
        y_m=centre.y,
        yaw_deg=math.degrees(front.yaw),
        length_m=_LENGTH_M,
        width_m=width_m,
        depth_m=depth_m,
    )
    beside = width_m < 12.0 and direction != "turn" and bool(random.integers(2))
    ramps = [_beside(front, width_m, random)] if beside else []
    what = f"{direction}, {depth_m:g} m deep, {width_m:g} m wide, {speed_mps:.2f} m/s{', ramp beside' if ramps else ''}"
    return Case(seed, what, chair, _world([pit], ramps), IDENTITY, legs, run_s)


def passable(number: int, seed: int) -> Case:
    """A passable route, driven to its end."""
    kind, chair = PASSABLE[number % len(PASSABLE)], number // len(PASSABLE) % 2 == 0
    random = np.random.default_rng(seed)
    most_mps = 1.0 if chair else 1.5
    speed_mps, slope_deg = random.choice([0.5, 0.8, 1.0]) * most_mps, random.uniform(*_RAMP_DEG)
    foot_m = 3.5 + random.uniform(0.0, 1.0)
    height_m = 5.0 * math.sin(math.radians(slope_deg))
    ramp = Ramp(name="ramp", x_m=foot_m, y_m=0.0, slope_deg=slope_deg, height_m=height_m, width_m=3.0, top_length_m=4.0)
    pits, ramps, walls, start, to_m = [], [ramp], list[Box](), IDENTITY, foot_m + ramp.run_m + 2.0
    if kind == "ramp_over":
        to_m = foot_m + ramp.total_length_m + 1.0
    elif kind == "ramp_down":
        start = Pose2(foot_m + ramp.run_m + 1.0, 0.0, 0.0)
        to_m = 3.0 + ramp.run_m + 2.0
    elif kind == "kerb_down":
        pits = [Pit(name="road", x_m=foot_m + 4.0, y_m=0.0, length_m=8.0, width_m=12.0, depth_m=_KERB_M)]
        ramps, to_m = [], foot_m + 3.0
    elif kind == "wall":
        walls = [_wall(side, random.uniform(1.1, 1.4)) for side in (-1.0, 1.0)]
        ramps, to_m = [], 8.0
    elif kind == "level":
        ramps, to_m = [], 8.0
    legs = (Leg(Twist2(speed_mps, 0.0, 0.0), to_m), Leg(Twist2(0.0, 0.0, 0.0), math.inf))
    world = _world(pits, ramps).model_copy(update={"walls": walls})
    what = f"{kind}, {speed_mps:.2f} m/s{f', {slope_deg:.1f} deg' if ramps else ''}"
    return Case(seed, what, chair, world, start, legs, SETTLE_S + 7.0 + 1.5 * to_m / speed_mps, to_m)


@cache
def contacts(*, chair: bool) -> NDArray[np.float64]:
    """(n, 2) ground contact points of the wheels, and of the wheelchair's castors, in base_link."""
    wheels = np.array(load_robot().module_positions_m())
    return np.concatenate([wheels, np.add(castors(), (chair_ahead().x, 0.0))]) if chair else wheels


def _wall(side: float, aside_m: float) -> Box:
    return Box(name=f"wall{side:+.0f}", x_m=5.0, y_m=side * aside_m, length_m=16.0, width_m=0.2, height_m=2.0)


def _beside(front: Pose2, width_m: float, random: np.random.Generator) -> Ramp:
    """Ramps up and down beside the drop, off the route."""
    side = random.choice([-1.0, 1.0])
    foot = front.compose(Pose2(0.0, side * (0.5 * width_m + 1.2), 0.0))
    return Ramp(
        name="ramp",
        x_m=foot.x,
        y_m=foot.y,
        yaw_deg=math.degrees(foot.yaw),
        slope_deg=random.uniform(*_RAMP_DEG),
        height_m=0.3,
        width_m=1.6,
        top_length_m=1.5,
    )


def _world(pits: list[Pit], ramps: list[Ramp]) -> WorldFile:
    return load_world("flat").model_copy(update={"pits": pits, "ramps": ramps})
