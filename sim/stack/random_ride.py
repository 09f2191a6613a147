"""A scenario drawn from a seed: a mission, a goal along a route of the yard, or manual driving that ignores obstacles.

Half of the goals and of the rides by hand begin with a wheelchair and a passenger on board. The routes pass ramps,
pits, a puddle, a narrow gate and the paths of people; manual driving may head for any of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from robot_stack.core.geometry import Pose2
from sim.polyline import Polyline
from sim.scheduler.streams import Streams
from sim.settings import SHORT_MISSION, SHORT_START
from sim.worldfile import WorldFile

_LIMIT_S: Final = 60.0
_GOAL_AHEAD_M: Final = (6.0, 14.0)
_PASSENGER_KG: Final = (40.0, 120.0)
# Distance of a start from the paths of people, from ramps, from pits and from corners of its route, where a chair might
# intersect a wall: contacts or tilt at the start prove nothing.
_CLEAR_M: Final = 2.0
_TRIES: Final = 100
_HAND_PHASES, _HAND_PHASE_S = 6, (3.0, 8.0)
_HAND_MPS, _HAND_RADPS = 1.5, 0.6


def random_ride(seed: int, world: WorldFile) -> dict[str, Any]:
    """The fields ``start``, ``mission``, ``goals``, ``twists`` and ``passenger_mass_kg`` of a scenario in ``world``."""
    random = Streams(seed).generator("ride")
    kind, loaded, mass = random.random(3).tolist()
    found: dict[str, Any] = {"limit_s": _LIMIT_S}
    if kind < 0.25:
        return found | {"mission": SHORT_MISSION, "start": place(SHORT_START)}
    if loaded < 0.5:
        low, high = _PASSENGER_KG
        found["passenger_mass_kg"] = round(low + mass * (high - low), 1)
    start, goal = _ends(random, world)
    found["start"] = place(start)
    return found | ({"goals": [place(goal)]} if kind < 0.75 else {"twists": list(_by_hand(random))})


def place(pose: Pose2) -> dict[str, float]:
    return {"x_m": pose.x, "y_m": pose.y, "yaw_deg": math.degrees(pose.yaw)}


def _ends(random: np.random.Generator, world: WorldFile) -> tuple[Pose2, Pose2]:
    """Two poses on one route, the second further along, the first clear of hazards."""
    routes = list(world.routes.values())
    for _ in range(_TRIES):
        which, along, further = random.random(3).tolist()
        points = routes[int(which * len(routes))].points_m
        line = Polyline(points)
        start_m = along * line.length_m
        start = line.pose_at(start_m)
        corners_m = (math.dist((start.x, start.y), point) for point in points)
        if min(*corners_m, *_hazards_m(world, start)) > _CLEAR_M:
            low, high = _GOAL_AHEAD_M
            return start, line.pose_at(start_m + low + further * (high - low))
    raise ValueError(f"no place on the routes is {_CLEAR_M} m from people, ramps, pits and corners")


def _hazards_m(world: WorldFile, pose: Pose2) -> Iterator[float]:
    """Distances to the paths of people, to ramps, and to the middle of pits, less a pit's half diagonal."""
    for person in world.people:
        yield Polyline(person.points_m).distance_m(pose.x, pose.y)
    for ramp in world.ramps:
        foot, length_m = (ramp.x_m, ramp.y_m), ramp.total_length_m
        end = (ramp.x_m + length_m * math.cos(ramp.yaw_rad), ramp.y_m + length_m * math.sin(ramp.yaw_rad))
        yield Polyline([foot, end]).distance_m(pose.x, pose.y) - 0.5 * ramp.width_m
    for pit in world.pits:
        yield math.dist((pose.x, pose.y), (pit.x_m, pit.y_m)) - 0.5 * math.hypot(pit.length_m, pit.width_m)


def _by_hand(random: np.random.Generator) -> Iterator[dict[str, float]]:
    at_s = 0.5
    for _ in range(_HAND_PHASES):
        speed, heading, turning, lasting = random.random(4).tolist()
        angle, speed_mps = 2.0 * math.pi * heading, speed * _HAND_MPS
        yield {
            "at_s": round(at_s, 3),
            "vx_mps": round(speed_mps * math.cos(angle), 3),
            "vy_mps": round(speed_mps * math.sin(angle), 3),
            "omega_radps": round((2.0 * turning - 1.0) * _HAND_RADPS, 3),
        }
        low, high = _HAND_PHASE_S
        at_s += low + lasting * (high - low)
