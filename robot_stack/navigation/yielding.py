"""Resolves a stand-off, in which a pedestrian waits for the robot and the robot for the pedestrian.

A person nearer to the robot than the wanted gap leaves no motion along the route. The robot then yields: it moves
slowly to the side that leaves the person the most room.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.robot import Footprint
from robot_stack.navigation.footprint import box_of, outline
from robot_stack.navigation.local_map import LocalMap
from robot_stack.navigation.params import GiveWayParams
from robot_stack.navigation.rollout_kernels import free_time, person_gap

Array = npt.NDArray[np.float64]
_DIRECTIONS = 16
_X, _Y, _RADIUS = 0, 1, 4
# Value of a metre out of a person's line, in metres of room.
_ASIDE = 1.0


def nearest_m(pose: Pose2, footprint: Footprint, people: Array) -> float:
    """Metres from the footprint to the nearest of ``people`` (m, 6), in their frame; infinite without any."""
    return _gap(box_of(footprint), np.array([pose.x, pose.y, pose.yaw]), people)


def way_out(
    pose: Pose2,
    footprint: Footprint,
    local: LocalMap,
    people: Array,
    margin_m: float,
    params: GiveWayParams,
    room_m: float | None = None,
    turn_rad: float = 0.0,
) -> Twist2 | None:
    """The motion (base_link) that leaves people the most room, and the line of the nearest free.

    None if there is enough room, or if no motion is clear and effective.

    pose: costmap's frame. people: (m, 6) x, y, vx, vy, radius, wanted gap. margin_m: to static obstacles.
    room_m: enough room; by default as in ``params``. turn_rad: to the heading of the way, which is turned to meanwhile.
    """
    room_m = params.room_m if room_m is None else room_m
    at, box, edge = np.array([pose.x, pose.y, pose.yaw]), box_of(footprint), outline(footprint)
    field, margin_m = local.leaving(edge, at, margin_m, 0.02)
    place = field, local.resolution_m, local.x_m, local.y_m
    now_m = _gap(box, at, people)
    if now_m >= room_m:
        return None
    best, best_m = None, now_m + params.least_m
    before = min(people, key=lambda one: math.hypot(one[_X] - at[0], one[_Y] - at[1]))
    for k in range(_DIRECTIONS):
        course = 2.0 * math.pi * k / _DIRECTIONS
        omega = max(-params.turn_radps, min(params.turn_radps, turn_rad / params.look_s))
        twist = np.array([params.speed_mps * math.cos(course), params.speed_mps * math.sin(course), omega])
        then = _after(at, twist, params.look_s)
        gap_m = min(_gap(box, then, people), room_m) + _ASIDE * _beside(at, then, before)
        if gap_m <= best_m + 1e-6:
            continue
        if free_time(*place, edge, at, twist, margin_m, params.look_s, box, people) >= params.look_s:
            best, best_m = Twist2(*map(float, twist)), gap_m
    return best


def _beside(at: Array, then: Array, person: Array) -> float:
    """Metres by which a motion leaves the line from a person to the robot, the person's expected way."""
    lx, ly = at[0] - person[_X], at[1] - person[_Y]
    far_m = max(math.hypot(lx, ly), 1e-6)
    return float(abs(lx * (then[1] - at[1]) - ly * (then[0] - at[0])) / far_m)


def _gap(box: Array, at: Array, people: Array) -> float:
    x, y, yaw = map(float, at)
    gaps = (person_gap(box, x, y, yaw, float(one[_X]), float(one[_Y]), float(one[_RADIUS])) for one in people)
    return min(gaps, default=math.inf)


def _after(at: Array, twist: Array, time_s: float) -> Array:
    c, s = math.cos(at[2]), math.sin(at[2])
    return at + time_s * np.array([c * twist[0] - s * twist[1], s * twist[0] + c * twist[1], twist[2]])
