"""Converts wheel set points to moves of the engine's axes, in rad at the wheel and at the steering axis.

Set points come in steps. An axis gets the acceleration with which it reaches the next set point when that arrives, so
that wheels and headings move evenly; changes beyond the limits are spread over the time
they need, the same for all four wheels.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robot_stack.contract.frames import MODULES
from robot_stack.drive.kinematics import Four, ModuleSetPoints, nearest_equivalent
from robot_stack.wmx.timed_velocity import speed_change

# The engine rejects a change in zero time and motion at zero speed.
_LEAST_ACCELERATION_RADPS2 = 0.5
_LEAST_RATE_RADPS = 0.05
# Of the softest slowing: a wheel with a smaller change keeps its speed; the jolt is imperceptible.
_STEADY = 0.25
# Headings come as float64 of an angle wrapped in float64: rounding only.
_ANGLE_SLACK_RAD = 1e-9


class BadWheelCommands(ValueError):
    """Wheel commands that must not be carried out. The message names the field and its limit."""


@dataclass(frozen=True, slots=True)
class AxisSettings:
    """drive_axes, steer_axes: the engine's axes by module. period_s: between set points. steering_periods: in how many
    of them a heading reaches its set point; more than one keeps a steadily turning axis from stopping between set
    points. max_wheel_acceleration_mps2: of ordinary changes. stop_deceleration_mps2: of a command of zero for all
    wheels, and of wheels whose commands have ended. command_lifetime_s: timeout after which the engine stops a wheel
    without a new command. softest_slowing_mps2: of decelerating wheels, and of their stop if the commands end just
    then.
    """

    drive_axes: tuple[int, ...]
    steer_axes: tuple[int, ...]
    wheel_radius_m: float
    max_wheel_speed_mps: float
    period_s: float
    max_wheel_acceleration_mps2: float
    stop_deceleration_mps2: float
    max_steering_rate_radps: float
    max_steering_acceleration_radps2: float
    steering_periods: float
    command_lifetime_s: float
    softest_slowing_mps2: float


@dataclass(frozen=True, slots=True)
class DriveMove:
    """Moves a wheel's axis to a signed speed. acceleration_radps2: for a growing speed. deceleration_radps2: for a
    falling one, and for the stop at the end of the command: the engine has one value for both. growth_s: of the speed.
    reached_s: the whole change.
    """

    axis: int
    velocity_radps: float
    acceleration_radps2: float
    deceleration_radps2: float
    growth_s: float
    reached_s: float


@dataclass(frozen=True, slots=True)
class SteerMove:
    """Moves a steering axis to an accumulated angle, at a limited rate."""

    axis: int
    target_rad: float
    rate_radps: float
    acceleration_radps2: float


def checked_set_points(
    module_ids: Sequence[int],
    speeds_mps: Sequence[float],
    angles_rad: Sequence[float],
    max_wheel_speed_mps: float,
) -> ModuleSetPoints:
    """The set points in module order. Raises BadWheelCommands for invalid ones."""
    if sorted(module_ids) != list(range(len(MODULES))):
        raise BadWheelCommands(f"module_id must be 0..3, each once, is {', '.join(map(str, module_ids)) or 'empty'}")
    speeds, angles = [0.0] * len(MODULES), [0.0] * len(MODULES)
    for module, speed, angle in zip(module_ids, speeds_mps, angles_rad, strict=True):
        if not abs(speed) <= max_wheel_speed_mps:  # also refuses NaN
            raise BadWheelCommands(
                f"drive_velocity of {MODULES[module]} must be within +-{max_wheel_speed_mps:.3f} m/s, is {speed}"
            )
        if not abs(angle) <= math.pi + _ANGLE_SLACK_RAD:
            raise BadWheelCommands(f"steering_angle of {MODULES[module]} must be within +-pi rad, is {angle}")
        speeds[module], angles[module] = float(speed), float(angle)
    return ModuleSetPoints(_four(speeds), _four(angles))


def drive_moves(speeds_mps: Four, velocities_radps: Sequence[float], settings: AxisSettings) -> list[DriveMove]:
    """Moves from the axes' present commanded ``velocities_radps`` to ``speeds_mps``, all arriving together: with the
    next set point, or as soon as the limits allow. Zero for all wheels is a stop and may be harder.

    A change longer than the command's lifetime ends early: an accelerating wheel must not keep accelerating after the
    commands end. The engine stops a decelerating wheel at the same rate, because both use one profile: so it
    decelerates at no less than ``softest_slowing_mps2``, and may arrive before the
    next set point. A wheel that keeps or gains speed is stopped at the stop deceleration.
    """
    if not any(speeds_mps):
        return stop_moves(velocities_radps, settings, settings.period_s)
    hardest_radps2 = settings.max_wheel_acceleration_mps2 / settings.wheel_radius_m
    targets = [speed / settings.wheel_radius_m for speed in speeds_mps]
    changes = [target - now for target, now in zip(targets, velocities_radps, strict=True)]
    seconds = max(settings.period_s, max(map(abs, changes)) / hardest_radps2)
    share = min(1.0, settings.command_lifetime_s / seconds)
    moves = []
    for axis, now, target, change in zip(settings.drive_axes, velocities_radps, targets, changes, strict=True):
        reached = target if share == 1.0 else now + share * change
        rate_mps2 = abs(change) / seconds * settings.wheel_radius_m
        slows_down = abs(reached) < abs(now) and rate_mps2 > _STEADY * settings.softest_slowing_mps2
        softest_mps2 = settings.softest_slowing_mps2 if slows_down else settings.stop_deceleration_mps2
        moves.append(_move(axis, now, reached, abs(change) / seconds, softest_mps2 / settings.wheel_radius_m))
    return moves


def stop_moves(velocities_radps: Sequence[float], settings: AxisSettings, least_s: float = 0.0) -> list[DriveMove]:
    """Moves of all wheels to standstill, at the stop deceleration at every call. They stop
    together, after ``least_s`` at the earliest.
    """
    hardest_radps2 = settings.stop_deceleration_mps2 / settings.wheel_radius_m
    seconds = max(least_s, max(map(abs, velocities_radps)) / hardest_radps2)
    return [
        _move(axis, now, 0.0, abs(now) / seconds if seconds else 0.0, 0.0)
        for axis, now in zip(settings.drive_axes, velocities_radps, strict=True)
    ]


def _move(axis: int, now: float, target: float, rate_radps2: float, softest_radps2: float) -> DriveMove:
    """The move at a rate; a falling speed at ``softest_radps2`` at least."""
    acceleration = max(rate_radps2, _LEAST_ACCELERATION_RADPS2)
    deceleration = max(acceleration, softest_radps2)
    grows, falls = speed_change(now, target)
    growth_s = grows / acceleration
    return DriveMove(axis, target, acceleration, deceleration, growth_s, growth_s + falls / deceleration)


def steer_moves(angles_rad: Four, positions_rad: Sequence[float], settings: AxisSettings) -> list[SteerMove]:
    """Moves from the axes' present commanded ``positions_rad`` (any number of turns) to the nearest of the angles."""
    seconds = settings.steering_periods * settings.period_s
    moves = []
    for axis, angle, position in zip(settings.steer_axes, angles_rad, positions_rad, strict=True):
        target = nearest_equivalent(angle, position)
        rate = min(settings.max_steering_rate_radps, max(abs(target - position) / seconds, _LEAST_RATE_RADPS))
        moves.append(SteerMove(axis, target, rate, settings.max_steering_acceleration_radps2))
    return moves


def _four(values: Sequence[float]) -> Four:
    a, b, c, d = values
    return a, b, c, d
