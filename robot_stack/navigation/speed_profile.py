"""Jerk-limited motion along one coordinate (ruckig)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import ruckig

# Shares of the limits, tried in this order.
_SHARES = (1.0, 0.99993, 0.9998, 0.99951)


@dataclass(frozen=True, slots=True)
class AxisLimits:
    """Largest speed, acceleration and jerk of one coordinate, in its unit and seconds."""

    speed: float
    acceleration: float
    jerk: float


class Profile:
    """Position, speed and acceleration of one coordinate over time; time is clamped to [0, duration_s]."""

    __slots__ = ("_trajectory", "duration_s")

    def __init__(self, trajectory: ruckig.Trajectory) -> None:
        self._trajectory = trajectory
        self.duration_s: float = trajectory.duration

    def at(self, time_s: float) -> tuple[float, float, float]:
        """(position, speed, acceleration)."""
        position, speed, acceleration = self._trajectory.at_time(min(max(time_s, 0.0), self.duration_s))
        return position[0], speed[0], acceleration[0]

    def extent(self) -> tuple[float, float]:
        """Smallest and largest position on the way."""
        bound = self._trajectory.position_extrema[0]
        return bound.min, bound.max


def to_position(
    distance: float, speed: float, acceleration: float, limits: AxisLimits, min_duration_s: float = 0.0
) -> Profile:
    """From 0 with ``speed`` and ``acceleration`` to rest at ``distance``, as fast as the limits allow.

    A start outside the limits is brought inside first. ``min_duration_s`` requests a slower motion of that duration.
    Raises ValueError for numbers that are not finite.
    """
    requested = _input(speed, acceleration, limits)
    requested.target_position = [distance]
    requested.target_velocity = [0.0]
    natural = _solve(requested)
    if min_duration_s <= natural.duration_s:
        return natural
    requested.minimum_duration = min_duration_s
    return _solve(requested)


def to_speed(target_speed: float, speed: float, acceleration: float, limits: AxisLimits) -> Profile:
    """From 0 with ``speed`` and ``acceleration`` to a steady ``target_speed``. Raises ValueError as above."""
    requested = _input(speed, acceleration, limits)
    requested.control_interface = ruckig.ControlInterface.Velocity
    requested.target_velocity = [target_speed]
    return _solve(requested)


def _input(speed: float, acceleration: float, limits: AxisLimits) -> ruckig.InputParameter:
    requested = ruckig.InputParameter(1)
    requested.current_position = [0.0]
    requested.current_velocity = [speed]
    requested.current_acceleration = [acceleration]
    requested.target_acceleration = [0.0]
    requested.max_velocity = [limits.speed]
    requested.max_acceleration = [limits.acceleration]
    requested.max_jerk = [limits.jerk]
    return requested


def _solve(requested: ruckig.InputParameter) -> Profile:
    """The profile for ``requested``.

    Ruckig fails exactly at the boundary of two kinds of profile, e.g. over 0.4 m with 0.8 m/s2 and 1.6 m/s3, where
    the acceleration just reaches its limit. Limits smaller by less than a thousandth avoid such a point.
    """
    problem = ""
    limits = requested.max_velocity, requested.max_acceleration, requested.max_jerk
    for share in _SHARES:
        requested.max_velocity, requested.max_acceleration, requested.max_jerk = (
            [share * limit[0]] for limit in limits
        )
        trajectory = ruckig.Trajectory(1)
        try:
            result = ruckig.Ruckig(1).calculate(requested, trajectory)
        except ruckig.RuckigError as error:
            problem = " ".join(str(error).split())
            continue
        if result in (ruckig.Result.Working, ruckig.Result.Finished) and math.isfinite(trajectory.duration):
            return Profile(trajectory)
        problem = str(result)
    raise ValueError(f"no motion profile: {problem}")
