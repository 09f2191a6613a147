"""From wheel set points to moves of the engine's axes, in rad at the wheel and at the steering axis.

Set points come in steps. An axis is given just the speed of change that brings it to the next set point when that
arrives, so that wheels and headings move evenly instead of leaping and waiting; harder changes are spread over the time
they need, the same for all four wheels.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robot_stack.contract.frames import DRIVE_AXES, MODULES, STEER_AXES
from robot_stack.drive.kinematics import Four, ModuleSetPoints, nearest_equivalent

# The engine takes no change in zero time and no motion at zero speed.
_LEAST_ACCELERATION_RADPS2 = 0.5
_LEAST_RATE_RADPS = 0.05
# Headings come as float64 of an angle wrapped in float64: rounding only.
_ANGLE_SLACK_RAD = 1e-9


class BadWheelCommands(ValueError):
    """Wheel commands that must not be carried out. The message names the field and its limit."""


@dataclass(frozen=True, slots=True)
class AxisSettings:
    """period_s: between set points. steering_periods: in how many of them a heading reaches its set point; more than
    one keeps a steadily turning axis from stopping between set points. max_wheel_acceleration_mps2: of ordinary
    changes. stop_deceleration_mps2: of a command of zero for all wheels.
    """

    wheel_radius_m: float
    max_wheel_speed_mps: float
    period_s: float
    max_wheel_acceleration_mps2: float
    stop_deceleration_mps2: float
    max_steering_rate_radps: float
    max_steering_acceleration_radps2: float
    steering_periods: float


@dataclass(frozen=True, slots=True)
class DriveMove:
    """A wheel's axis to a signed speed at an acceleration."""

    axis: int
    velocity_radps: float
    acceleration_radps2: float


@dataclass(frozen=True, slots=True)
class SteerMove:
    """A steering axis to an accumulated angle, at most at a rate."""

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
    """The set points in module order. Raises BadWheelCommands for what cannot or must not be done."""
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
    """
    stop = not any(speeds_mps)
    hardest_mps2 = settings.stop_deceleration_mps2 if stop else settings.max_wheel_acceleration_mps2
    targets = [speed / settings.wheel_radius_m for speed in speeds_mps]
    return _together(targets, velocities_radps, hardest_mps2 / settings.wheel_radius_m, settings.period_s)


def stop_moves(velocities_radps: Sequence[float], settings: AxisSettings) -> list[DriveMove]:
    """Moves of all wheels to standstill, at the stop deceleration whenever they are asked for anew."""
    hardest_radps2 = settings.stop_deceleration_mps2 / settings.wheel_radius_m
    return _together([0.0] * len(DRIVE_AXES), velocities_radps, hardest_radps2, 0.0)


def _together(
    targets: Sequence[float], velocities: Sequence[float], hardest_radps2: float, least_s: float
) -> list[DriveMove]:
    changes = [abs(target - now) for target, now in zip(targets, velocities, strict=True)]
    seconds = max(least_s, max(changes) / hardest_radps2)
    return [
        DriveMove(axis, target, max(change / seconds if seconds else 0.0, _LEAST_ACCELERATION_RADPS2))
        for axis, target, change in zip(DRIVE_AXES, targets, changes, strict=True)
    ]


def steer_moves(angles_rad: Four, positions_rad: Sequence[float], settings: AxisSettings) -> list[SteerMove]:
    """Moves from the axes' present commanded ``positions_rad`` (any number of turns) to the nearest of the angles."""
    seconds = settings.steering_periods * settings.period_s
    moves = []
    for axis, angle, position in zip(STEER_AXES, angles_rad, positions_rad, strict=True):
        target = nearest_equivalent(angle, position)
        rate = min(settings.max_steering_rate_radps, max(abs(target - position) / seconds, _LEAST_RATE_RADPS))
        moves.append(SteerMove(axis, target, rate, settings.max_steering_acceleration_radps2))
    return moves


def _four(values: Sequence[float]) -> Four:
    a, b, c, d = values
    return a, b, c, d
