"""Speed along the route: slow in narrow places, in speed zones and near people, zero for crossing pedestrians."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robot_stack.core.limits import MotionLimits
from robot_stack.core.people import Person
from robot_stack.core.robot import Footprint
from robot_stack.navigation.params import PassageParams, PeopleParams, SpeedLimitParams
from robot_stack.navigation.passing import comes_along, course

Array = npt.NDArray[np.float64]
_TIME_STEP_S = 0.2


@dataclass(frozen=True, slots=True)
class SpeedLimits:
    """speed_mps: (n,) along the route. yields: the robot yields to a crossing pedestrian."""

    speed_mps: Array
    yields: bool


def narrow_speed(clearance_m: Array, cruise_mps: float, params: SpeedLimitParams) -> Array:
    """(n,) the speed that a clearance allows: slow_speed_mps up to slow_clearance_m, cruise from free_clearance_m."""
    slow = min(params.slow_speed_mps, cruise_mps)
    speeds: Array = np.interp(clearance_m, (params.slow_clearance_m, params.free_clearance_m), (slow, cruise_mps))
    return speeds


def speed_limits(
    route: Array,
    clearance_m: Array,
    zones_mps: Array,
    people: tuple[Person, ...],
    now_s: float,
    speed_mps: float,
    limits: MotionLimits,
    footprint: Footprint,
    params: SpeedLimitParams,
    person: PeopleParams,
    passage: PassageParams | None,
    lets_pass: bool,
) -> SpeedLimits:
    """route: (n, 4) x, y, yaw, along from the robot on, evenly spaced. speed_mps: of the robot now.

    zones_mps: (n,) allowed by the site's speed zones.
    passage: a robot that has to stop for a person does so before a narrow place, not in it; None: where the ways cross.
    lets_pass: else it stops only before narrow places, and people elsewhere limit its speed alone, as do people who
    come along the way, whom it passes beside it.
    """
    speeds = np.minimum(narrow_speed(clearance_m, limits.speed_mps, params), zones_mps)
    direction = course(route)
    for one in people:
        x, y = one.at(now_s)
        gap = _gap(route, (x, y), footprint) - one.radius_m
        near_mps = np.interp(gap, (person.very_near_m, person.near_m), (person.very_near_mps, person.near_mps))
        ahead_m = direction[:, 0] * (x - route[:, 0]) + direction[:, 1] * (y - route[:, 1])
        # The robot drives away from people behind it.
        near = (gap < person.near_m) & (ahead_m > footprint.rear_m - one.radius_m)
        speeds = np.where(near, np.minimum(speeds, near_mps), speeds)
    stop_m = np.inf
    for one in people:
        if not one.walks:
            continue
        stops_m, comes = _conflict(route, one, now_s, speed_mps, footprint, person)
        before_m = stops_m
        if np.isfinite(stops_m) and passage is not None:
            before_m = outside(stops_m, route, clearance_m, one.at(now_s), footprint, passage)
        if (lets_pass and not comes) or before_m < stops_m:
            stop_m = min(stop_m, before_m)
    if np.isfinite(stop_m):
        speeds = np.where(route[:, 3] >= stop_m, 0.0, speeds)
    return SpeedLimits(
        _braking(speeds, route[:, 3], params.braking_share * limits.acceleration_mps2), bool(np.isfinite(stop_m))
    )


def _gap(route: Array, person: tuple[float, float], footprint: Footprint) -> Array:
    """(n,) metres from a person's middle to the robot at each pose, whose front end may reach far before base_link."""
    half_m = 0.5 * footprint.width_m
    dx, dy = person[0] - route[:, 0], person[1] - route[:, 1]
    c, s = np.cos(route[:, 2]), np.sin(route[:, 2])
    ahead = np.clip(c * dx + s * dy, 0.0, max(footprint.front_m - half_m, 0.0))
    return np.asarray(np.hypot(dx - ahead * c, dy - ahead * s) - half_m)


def outside(
    stop_m: float,
    route: Array,
    clearance_m: Array,
    person: tuple[float, float],
    footprint: Footprint,
    params: PassageParams,
) -> float:
    """``stop_m``, moved back to before the narrow place in which, or right behind which, the robot would stand.

    The passage belongs to who is in it, or else nearer to it: only the other waits outside, with ``wait_m`` of room.

    route: (n, 4) x, y, yaw, along from the robot on. clearance_m: (n,). person: x, y, in the route's frame.
    """
    along_m, narrow = route[:, 3], clearance_m < params.narrow_m
    if narrow[0]:
        return stop_m
    # Standing here, the robot would leave no room between its rear and the narrow place.
    stands = (along_m <= stop_m) & (along_m >= stop_m + footprint.rear_m - params.wait_m) & narrow
    if not stands.any():
        return stop_m
    last = int(np.flatnonzero(stands)[-1])
    entry = last - int(np.argmin(narrow[last::-1])) + 1
    further = narrow[entry:]
    leave = entry + (int(np.argmin(further)) if not further.all() else len(further)) - 1
    # The footprint is narrow from when its front comes to the place until its rear has left it.
    middle_m = 0.5 * (footprint.front_m + footprint.rear_m)
    place_m = 0.5 * (along_m[entry] + along_m[leave]) + middle_m
    place = route[int(np.argmin(np.abs(along_m - place_m)))]
    if place_m - middle_m < math.hypot(place[0] - person[0], place[1] - person[1]):
        return stop_m
    return float(along_m[entry]) - params.wait_m


def _conflict(
    route: Array, one: Person, now_s: float, speed_mps: float, footprint: Footprint, params: PeopleParams
) -> tuple[float, bool]:
    """Arc length at which to stop so that a walking person can pass, m; inf without a conflict. And whether the person
    comes along the way there.
    """
    times = np.arange(0.0, params.yield_horizon_s, _TIME_STEP_S)
    x, y = one.at(now_s)
    px, py = x + times * one.vx, y + times * one.vy
    gap = np.hypot(route[:, 0, None] - px, route[:, 1, None] - py) - one.radius_m - 0.5 * footprint.width_m
    # The robot is at a point from when its front reaches it until its rear has left it.
    pace = max(speed_mps, params.yield_pace_mps)
    arrives = (route[:, 3, None] - footprint.front_m) / pace - params.yield_time_s
    leaves = (route[:, 3, None] - footprint.rear_m) / pace + params.yield_time_s
    meets = (gap < params.yield_gap_m) & (times >= arrives) & (times <= leaves)
    # A person beside or behind the robot is no reason to yield: stopping would block the way.
    meets &= route[:, 3, None] > footprint.front_m * 0.5
    where = np.flatnonzero(meets.any(axis=1))
    if not len(where):
        return math.inf, False
    stop_m = float(route[where[0], 3] - footprint.front_m - params.yield_stop_m)
    return stop_m, comes_along(one, course(route)[where[0]])


def _braking(speeds: Array, along: Array, deceleration: float) -> Array:
    """Reduces the speed ahead of slow stretches, so that each is entered at its own speed."""
    out = speeds.copy()
    for i in range(len(out) - 2, -1, -1):
        out[i] = min(out[i], float(np.sqrt(out[i + 1] ** 2 + 2.0 * deceleration * (along[i + 1] - along[i]))))
    return out
