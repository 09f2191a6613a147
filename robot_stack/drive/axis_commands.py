"""Axis moves as commands to the motion engine.

A wheel in motion gets a timed velocity: the engine itself stops it at the end of the time unless another command
arrives, even if the client has died (WMX3 API reference, Velocity::StartVel of a TimedVelCommand). This is the dead-man
of the drive. The engine's watchdog is not: a library thread feeds it, and its timeout closes the device without
stopping an axis (page_WMXDOC_FUNC_WATCHDOG_BASIC). A timed velocity accepts only profiles by time; its run time counts
from when the velocity is reached. A wheel at rest needs no time, and a heading is a position, which the engine
reaches and holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from robot_stack.drive.wheel_axes import DriveMove, SteerMove
from robot_stack.wmx.api import CoreMotion, Motion_PosCommand, Profile, Velocity_TimedVelCommand, Velocity_VelCommand

# A time of zero would be a step; the engine's cycle is this long.
_SHORTEST_MS: Final = 1.0


def drive(core: CoreMotion, moves: Sequence[DriveMove], lifetime_s: float) -> int:
    """Commands the wheels; returns the engine's code. Wheels to be stopped go first, in a separate call."""
    velocity = core.velocity
    resting = [_rest(move) for move in moves if not move.velocity_radps]
    turning = [_turn(move, lifetime_s) for move in moves if move.velocity_radps]
    code = velocity.StartVel(len(resting), resting) if resting else 0
    if code or not turning:
        return code
    return velocity.StartVel_TimedVel(len(turning), turning)


def steer(core: CoreMotion, moves: Sequence[SteerMove]) -> int:
    """Commands the headings; returns the engine's code."""
    commands = [_heading(move) for move in moves]
    return core.motion.StartPos(len(commands), commands)


def _turn(move: DriveMove, lifetime_s: float) -> Velocity_TimedVelCommand:
    """Times chosen so that the engine's own deceleration begins ``lifetime_s`` from now."""
    to_rest_s = abs(move.velocity_radps) / move.deceleration_radps2
    return Velocity_TimedVelCommand(
        move.axis,
        max(1e3 * (lifetime_s - move.reached_s), _SHORTEST_MS),
        Profile.SetupTimeAccTrapezoidal(
            move.velocity_radps, max(1e3 * move.growth_s, _SHORTEST_MS), max(1e3 * to_rest_s, _SHORTEST_MS)
        ),
    )


def _rest(move: DriveMove) -> Velocity_VelCommand:
    rate = move.deceleration_radps2
    return Velocity_VelCommand(move.axis, Profile.SetupTrapezoidal(move.velocity_radps, rate, rate))


def _heading(move: SteerMove) -> Motion_PosCommand:
    rate = move.acceleration_radps2
    return Motion_PosCommand(move.axis, move.target_rad, Profile.SetupTrapezoidal(move.rate_radps, rate, rate))
