"""Drawn cases of the benchmark ``people``: the body, its target beside the robot, and the robot's manoeuvre."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from robot_stack.core.geometry import Pose2, Twist2, exp_se2
from robot_stack.core.robot import Robot
from robot_stack.safety.collision import Outline, outline_of
from tests.benchmarks.support.people_bodies import KINDS, SPEEDS_MPS, Body, Kind, Walker, contact, drawn_body
from tests.benchmarks.support.people_senses import chair_ahead

Manoeuvre = Literal["start", "drive", "turn", "dock"]
MANOEUVRES: tuple[Manoeuvre, ...] = ("start", "drive", "turn", "dock")
SIDES = 8  # counterclockwise from ahead
# One case of each kind, manoeuvre and side; cases with and without the chair alternate.
ROUND = len(KINDS) * len(MANOEUVRES) * SIDES
SETTLE_S = 1.0  # until all nodes are ready
_APART_M = 1.2  # initial gap
_TRIES = 200


@dataclass(frozen=True, slots=True)
class Case:
    """walker: in its initial state. requested: the command to the robot from ``request_s`` on, for the whole run.

    dock: pose of a wheelchair that the robot creeps towards. run_s: length of the whole run.
    """

    seed: int
    manoeuvre: Manoeuvre
    side: int
    chair: bool
    body: Body
    walker: Walker
    requested: Twist2
    request_s: float
    run_s: float
    dock: Pose2 | None = None


def drawn(number: int, seed: int, robot: Robot, kinds: tuple[Kind, ...] = KINDS) -> Case:
    """number: index of the combination within a round. Raises RuntimeError if no try gives a valid case."""
    combination, each = divmod(number, len(kinds))
    kind, manoeuvre, side = kinds[each], MANOEUVRES[combination % 4], combination // 4 % SIDES
    chair = bool((number + combination + combination // 4 + combination // 32) % 2)
    random = np.random.default_rng(seed)
    outline = outline_of(robot.footprint_with_chair if chair else robot.footprint)
    for _ in range(_TRIES):
        body = drawn_body(kind, random)
        arrive_s = random.uniform(2.0, 3.5)
        requested, request_s, dock = _robot_does(manoeuvre, side, chair, arrive_s, robot, random)
        speed_mps = random.uniform(*SPEEDS_MPS[kind])
        target = _target(outline, side, body, dock, random)
        there = exp_se2(requested, max(arrive_s - request_s, 0.0)).compose(Pose2(*target, 0.0))
        bearing = _bearing(side, dock, random) + there.yaw
        away_m = speed_mps * (SETTLE_S + arrive_s)
        x, y = there.x + away_m * math.cos(bearing), there.y + away_m * math.sin(bearing)
        begin = Pose2(x, y, bearing + math.pi)
        if contact(body, begin, outline).gap_m < _APART_M or _in_the_chair(begin, there, dock):
            continue
        walker = Walker(begin, target, speed_mps, through=bool(random.integers(2)))
        run_s = SETTLE_S + max(arrive_s, request_s) + 2.5
        return Case(seed, manoeuvre, side, chair, body, walker, requested, SETTLE_S + request_s, run_s, dock)
    raise RuntimeError(f"no case of {kind}, {manoeuvre}, side {side} with seed {seed}")


def _target(
    outline: Outline, side: int, body: Body, dock: Pose2 | None, random: np.random.Generator
) -> tuple[float, float]:
    """The target of the body's origin: some centimetres beside the outline, on the given side."""
    angle = 2.0 * math.pi * (side + random.uniform(-0.5, 0.5)) / SIDES
    middle, half_x = 0.5 * (outline.front + outline.rear), 0.5 * (outline.front - outline.rear)
    gap_m = random.uniform(0.02, 0.25) + body.radius_m
    x, y = half_x * math.cos(angle), outline.half * math.sin(angle)
    scale = 1.0 / max(abs(x) / half_x, abs(y) / outline.half)
    x, y = x * scale, y * scale
    if abs(abs(x) - half_x) < 1e-9:
        x += math.copysign(gap_m, x)
    if abs(abs(y) - outline.half) < 1e-9:
        y += math.copysign(gap_m, y)
    if dock is not None and x > half_x:
        y = max(-0.3, min(0.3, y))  # between robot and chair
    return middle + x, y


def _bearing(side: int, dock: Pose2 | None, random: np.random.Generator) -> float:
    """Direction of the walker's start, seen from its target, in base_link."""
    if dock is not None and side in (0, 1, SIDES - 1):  # the chair stands there
        return math.copysign(random.uniform(0.45, 0.55) * math.pi, 1 if side == 1 else -1)
    return 2.0 * math.pi * side / SIDES + random.uniform(-1.0, 1.0)


def _in_the_chair(begin: Pose2, there: Pose2, dock: Pose2 | None) -> bool:
    """True if the walker's line crosses the chair that waits at a dock."""
    if dock is None:
        return False
    steps = np.linspace(0.0, 1.0, 50)
    x, y = begin.x + steps * (there.x - begin.x), begin.y + steps * (there.y - begin.y)
    return bool(((np.abs(y - dock.y) < 0.6) & (x > dock.x - 0.2) & (x < dock.x + 1.2)).any())


def _robot_does(
    manoeuvre: Manoeuvre, side: int, chair: bool, arrive_s: float, robot: Robot, random: np.random.Generator
) -> tuple[Twist2, float, Pose2 | None]:
    """(command, its start, dock); the start in seconds after the settling time."""
    most_mps = robot.motion(chair).max_speed_mps
    match manoeuvre:
        case "start":
            towards = 2.0 * math.pi * side / SIDES + (random.uniform(-0.5, 0.5) if random.random() < 0.7 else math.pi)
            speed_mps = random.uniform(0.2, 1.0) * most_mps
            requested = Twist2(speed_mps * math.cos(towards), speed_mps * math.sin(towards), random.uniform(-0.3, 0.3))
            return requested, max(arrive_s + random.uniform(-0.8, 2.0), 0.0), None
        case "drive":
            way = random.choice([0.0, 0.0, 0.0, math.pi, 0.5 * math.pi, -0.5 * math.pi])
            speed_mps = random.uniform(0.2, 1.0) * most_mps
            requested = Twist2(speed_mps * math.cos(way), speed_mps * math.sin(way), random.uniform(-0.3, 0.3))
            return requested, 0.0, None
        case "turn":
            return Twist2(0.0, 0.0, random.choice([-1.0, 1.0]) * random.uniform(0.2, 1.0)), 0.0, None
        case "dock":
            return _docks(chair, arrive_s, random)


def _docks(chair: bool, arrive_s: float, random: np.random.Generator) -> tuple[Twist2, float, Pose2 | None]:
    """Without the chair, creeps to one that stands ahead; with it, creeps on to put it down, or backs off."""
    speed_mps = random.uniform(0.04, 0.15)
    if not chair:
        return Twist2(speed_mps, 0.0, 0.0), 0.0, chair_ahead().compose(Pose2(random.uniform(0.6, 1.2), 0.0, 0.0))
    back = random.random() < 0.5
    requested = Twist2(-random.uniform(0.1, 0.3) if back else speed_mps, 0.0, 0.0)
    return requested, max(arrive_s - random.uniform(0.0, 2.0), 0.0), None
