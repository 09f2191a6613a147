"""Axis moves as commands to the motion engine.

A wheel in motion gets a timed velocity, the dead-man of the drive. A wheel at rest needs no time, and a heading is a
position, which the engine reaches and holds.
"""

from __future__ import annotations

from collections.abc import Sequence

from robot_stack.drive.wheel_axes import DriveMove, SteerMove
from robot_stack.wmx.api import CoreMotion, Motion_PosCommand, Profile, Velocity_TimedVelCommand, Velocity_VelCommand
from robot_stack.wmx.timed_velocity import by_times, start, timed


def drive(core: CoreMotion, moves: Sequence[DriveMove], lifetime_s: float) -> int:
    """Commands the wheels; returns the engine's code."""
    resting = [_rest(move) for move in moves if not move.velocity_radps]
    return start(core, resting, [_turn(move, lifetime_s) for move in moves if move.velocity_radps])


def steer(core: CoreMotion, moves: Sequence[SteerMove]) -> int:
    """Commands the headings; returns the engine's code."""
    commands = [_heading(move) for move in moves]
    return core.motion.StartPos(len(commands), commands)


def _turn(move: DriveMove, lifetime_s: float) -> Velocity_TimedVelCommand:
    """Times chosen so that the engine's own deceleration begins ``lifetime_s`` from now."""
    to_rest_s = abs(move.velocity_radps) / move.deceleration_radps2
    profile = by_times(move.velocity_radps, move.growth_s, to_rest_s)
    return timed(move.axis, profile, lifetime_s - move.reached_s)


def _rest(move: DriveMove) -> Velocity_VelCommand:
    rate = move.deceleration_radps2
    return Velocity_VelCommand(move.axis, Profile.SetupTrapezoidal(move.velocity_radps, rate, rate))


def _heading(move: SteerMove) -> Motion_PosCommand:
    rate = move.acceleration_radps2
    return Motion_PosCommand(move.axis, move.target_rad, Profile.SetupTrapezoidal(move.rate_radps, rate, rate))
