"""Progress along the route: arrival, remaining distance and time.

Lengths in m along straight lines between waypoints, which is what a holonomic robot drives in free space.
"""

from __future__ import annotations

import math
from itertools import pairwise

from robot_stack.core.geometry import Pose2, Twist2, wrap_angle
from robot_stack.core.mission import Kind, Waypoint
from robot_stack.mission.params import MissionParams


def must_stand(stops: tuple[Waypoint, ...], index: int) -> bool:
    """True where the robot has to come to rest exactly: everywhere but at waypoints to pass, and always at the end."""
    return index == len(stops) - 1 or stops[index].action.kind is not Kind.PASS


def within(pose: Pose2, goal: Pose2, position_m: float, yaw_rad: float) -> bool:
    return pose.distance_to(goal) <= position_m and abs(wrap_angle(pose.yaw - goal.yaw)) <= yaw_rad


def at_waypoint(pose: Pose2, stops: tuple[Waypoint, ...], index: int, params: MissionParams) -> bool:
    """True if ``pose`` is within the waypoint's tolerance."""
    if must_stand(stops, index):
        return within(pose, stops[index].pose, params.position_tolerance_m, params.yaw_tolerance_rad)
    return within(pose, stops[index].pose, params.pass_position_tolerance_m, params.pass_yaw_tolerance_rad)


def standing(twist: Twist2 | None, params: MissionParams) -> bool:
    """True if the wheels stand. Unknown is not standing."""
    return (
        twist is not None
        and twist.is_finite()
        and twist.speed() <= params.standstill_speed_mps
        and abs(twist.omega) <= params.standstill_yaw_rate_radps
    )


def effort_m(pose: Pose2, goal: Pose2, distance_m: float, params: MissionParams) -> float:
    """Remaining distance to the goal, with the turn weighted as length: it must shrink for progress.

    distance_m: along the plan; NaN if unknown. It is never less than the straight line.
    """
    straight_m = pose.distance_to(goal)
    left_m = distance_m if distance_m > straight_m else straight_m
    return left_m + params.yaw_weight_m_per_rad * abs(wrap_angle(pose.yaw - goal.yaw))


def length_m(points: list[Pose2]) -> float:
    return math.fsum(a.distance_to(b) for a, b in pairwise(points))


def remaining_m(pose: Pose2, stops: tuple[Waypoint, ...], index: int) -> float:
    """Length from ``pose`` over all waypoints that are not served yet."""
    return length_m([pose, *(stop.pose for stop in stops[index:])])


def progress(start: Pose2 | None, pose: Pose2 | None, stops: tuple[Waypoint, ...], index: int) -> float:
    """Share of the route done, [0, 1], by length; by count of waypoints while a pose is unknown."""
    if index >= len(stops):
        return 1.0
    by_count = index / len(stops)
    if start is None or pose is None:
        return by_count
    total_m = length_m([start, *(stop.pose for stop in stops)])
    if total_m <= 0.0:
        return by_count
    return min(1.0, max(0.0, 1.0 - remaining_m(pose, stops, index) / total_m))


def waiting_s(stops: tuple[Waypoint, ...], index: int) -> float:
    """Waiting times at the waypoints not served yet."""
    return math.fsum(stop.action.wait_s for stop in stops[index:])


class MeanSpeed:
    """Speed along the route, smoothed over a time constant; NaN until the robot has moved."""

    def __init__(self, time_constant_s: float) -> None:
        self._time_constant_s = time_constant_s
        self.mps = math.nan

    def update(self, speed_mps: float, dt_s: float) -> None:
        if math.isnan(self.mps):
            self.mps = speed_mps
        else:
            self.mps += (speed_mps - self.mps) * (1.0 - math.exp(-dt_s / self._time_constant_s))
