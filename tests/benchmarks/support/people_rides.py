"""Rides of the benchmark ``people`` with a free path, which count false stops.

The route is a corridor of walls, kerbs and posts, and people walk past on both sides, all at least 0.5 m aside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import Pose2, Twist2, wrap_angle
from robot_stack.safety.collision import approach
from robot_stack.safety.collision_prediction import rests
from sim.lidar import labels
from sim.lidar.shapes import BOX, CYLINDER, Shape
from tests.benchmarks.support.people_bodies import Body, drawn_body
from tests.benchmarks.support.people_run import PASSING_M
from tests.benchmarks.support.people_senses import near
from tests.benchmarks.support.people_stage import STEP_S, Stage

_SWAY_M, _SWAY_LENGTH_M = 0.15, 14.0  # of the route about the corridor's middle
_AHEAD_M = 1.0
_START_S = 8.0
_PEOPLE = 6
_SECTION_M = 5.0
_SLOW_SHARE = 0.8
_NEAR_M = 7.0
_EDGE_M = 0.05


@dataclass(frozen=True, slots=True)
class Ride:
    """distance_m: driven. stops: false stops, with the monitor's details. justified: number of the other stops.

    slow_m: distance driven below 0.8 of the requested speed, except the first metres over unseen ground.
    """

    distance_m: float
    stops: tuple[str, ...]
    justified: int
    slow_m: float


@dataclass(slots=True)
class Passer:
    """Walks along the corridor, to and fro around the robot."""

    body: Body
    pose: Pose2
    speed_mps: float

    def step(self, dt_s: float, robot_x: float) -> None:
        self.pose = self.pose.compose(Pose2(self.speed_mps * dt_s, 0.0, 0.0))
        away = self.pose.x - robot_x
        if abs(away) > 9.0 and away * math.cos(self.pose.yaw) > 0.0:  # turns round out of the robot's view
            self.pose = Pose2(self.pose.x, self.pose.y, self.pose.yaw + math.pi)


def ride(seed: int, length_m: float, *, chair: bool) -> Ride:
    """Drives along x to ``length_m``; ends early after the start time and twice the nominal driving time."""
    random = np.random.default_rng([seed, 2])
    fixed, passers, speed_mps = _drawn(length_m, chair, random)
    edges = _edges(fixed)
    movers = {name: passer.body.shapes for name, passer in passers.items()}
    stage = Stage(seed, fixed, movers, chair=chair)
    if chair:
        stage.drive_in()
    distance_m, slow_m, justified, stopped, stops = 0.0, 0.0, 0, False, list[str]()
    for _ in range(round((_START_S + 2.0 * length_m / speed_mps) / STEP_S)):
        for name, passer in passers.items():
            passer.step(STEP_S, stage.body.pose.x)
            stage.poses[name] = passer.pose
        stage.requested = _follow(stage.body.pose, speed_mps)
        stage.advance()
        step_m = stage.body.twist.speed() * STEP_S
        distance_m += step_m
        slow_m += step_m if distance_m > 5.0 and stage.body.twist.speed() < _SLOW_SHARE * speed_mps else 0.0
        stops_now = stage.verdict.limit.linear_mps == 0.0 and distance_m > 0.0
        if stops_now and not stopped:
            if _in_the_way(stage, edges, passers):
                justified += 1
            else:
                stops.append(f"{distance_m:.1f} m: {'; '.join(stage.monitor.details.values())}")
        stopped = stops_now
        if distance_m >= length_m:
            break
    return Ride(distance_m, tuple(stops), justified, slow_m)


def _follow(pose: Pose2, speed_mps: float) -> Twist2:
    x = pose.x + _AHEAD_M
    y = _SWAY_M * math.sin(2.0 * math.pi * x / _SWAY_LENGTH_M)
    error = wrap_angle(math.atan2(y - pose.y, _AHEAD_M) - pose.yaw)
    return Twist2(speed_mps, 0.0, max(-0.5, min(0.5, 1.5 * error)))


def _drawn(length_m: float, chair: bool, random: np.random.Generator) -> tuple[list[Shape], dict[str, Passer], float]:
    """(static shapes, passers, requested speed)."""
    half_m = 0.40 if chair else 0.35
    # Beside the sway of the route, and of the front when the robot turns.
    aside_m = half_m + _SWAY_M + 2.0 * math.pi * _SWAY_M / _SWAY_LENGTH_M * (1.4 if chair else 0.5) + PASSING_M
    fixed = []
    for x in np.arange(-2.0 * _SECTION_M, length_m + 4.0 * _SECTION_M, _SECTION_M):
        for sign in (-1.0, 1.0):
            fixed += _section(float(x), sign, aside_m, random)
    passers = {}
    for index in range(_PEOPLE):
        body = drawn_body(random.choice(["child", "adult", "adult", "cart"]), random)
        y = random.choice([-1.0, 1.0]) * (aside_m + body.radius_m + random.uniform(0.0, 0.3))
        pose = Pose2(random.uniform(-8.0, 8.0), y, random.choice([0.0, math.pi]))
        passers[f"passer{index}"] = Passer(body, pose, random.uniform(0.4, 1.6))
    return fixed, passers, random.uniform(0.7, 1.0) * (1.0 if chair else 1.5)


def _section(x: float, sign: float, aside_m: float, random: np.random.Generator) -> list[Shape]:
    """Five metres of one side: a near wall, a kerb before a wall, posts before a wall, or a wall far away."""
    sort, light = random.integers(4), 0.5
    half_x = 0.5 * _SECTION_M
    far_m = aside_m + random.uniform(1.2, 2.5)
    wall_m = aside_m if sort == 0 else far_m
    shapes = [_box(x + half_x, sign * (wall_m + 0.1), (half_x, 0.1, 1.25), labels.OF_KIND["wall"], light)]
    if sort == 1:
        height_m = random.uniform(0.08, 0.15)
        size = (half_x, 0.15, 0.5 * height_m)
        shapes.append(_box(x + half_x, sign * (aside_m + 0.15), size, labels.OF_KIND["kerb"], 0.4))
    if sort == 2:
        for along in (0.2, 0.5, 0.8):
            place = (x + along * _SECTION_M, sign * (aside_m + 0.05), 0.5)
            shapes.append(Shape(CYLINDER, place, (0.05, 0.05, 0.5), labels.OF_KIND["cylinder"], 0.3))
    return shapes


def _box(x: float, y: float, half: tuple[float, float, float], label: int, light: float) -> Shape:
    return Shape(BOX, (x, y, half[2]), half, label, light)


def _edges(fixed: list[Shape]) -> NDArray[np.float64]:
    """(n, 2) points on the edges of the static shapes, in plan."""
    points = []
    for shape in fixed:
        x, y, half = *shape.centre_m[:2], shape.half_m
        along = np.arange(x - half[0], x + half[0] + _EDGE_M, _EDGE_M)
        points += [np.column_stack([along, np.full_like(along, y + side * half[1])]) for side in (-1.0, 1.0)]
    return np.concatenate(points)


def _in_the_way(stage: Stage, edges: NDArray[np.float64], passers: dict[str, Passer]) -> bool:
    """Applies the safety monitor's thresholds to true positions and to the robot's actual and commanded motion."""
    pose, limits = stage.body.pose, stage.params.collision
    bodies = [passer.body.outline(passer.pose) for passer in passers.values()]
    points = near(np.concatenate([edges, *bodies]), pose, _NEAR_M)
    for twist in (stage.body.twist, stage.body.set_point):
        ahead = None if rests(twist, limits) else approach(points, stage.outline, twist)
        if ahead is not None and (ahead.time_s < limits.stop_s or ahead.clearance_m < limits.stop_clearance_m):
            return True
    return False
