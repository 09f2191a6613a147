"""Requests of the session for one axis of the engine."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import Profile, Velocity_TimedVelCommand, Velocity_VelCommand

Request = Callable[[MotionEngine], int]
# A time of zero would be a step; the engine's cycle is this long.
_SHORTEST_MS: Final = 1.0
# A timed velocity of zero would be a rest with an end.
_SLOWEST_RADPS: Final = 1e-3


def quick_stop(axis: int) -> Request:
    """Tries the quick stops of both modes: the engine rejects that of the other mode."""

    def request(engine: MotionEngine) -> int:
        return engine.core_motion.velocity.ExecQuickStop(axis) and engine.core_motion.motion.ExecQuickStop(axis)

    return request


def rest(axis: int, within_s: float) -> Velocity_VelCommand:
    """To standstill within a time. It needs no timeout."""
    milliseconds = max(1e3 * within_s, _SHORTEST_MS)
    return Velocity_VelCommand(axis, Profile.SetupTimeAccTrapezoidal(0.0, milliseconds, milliseconds))


def run_at(
    axis: int, now_radps: float, speed_radps: float, within_s: float, stop_s: float, lifetime_s: float
) -> Velocity_TimedVelCommand:
    """From the present to another speed within a time, limited by the lifetime of a command; after that the engine
    stops the axis, from its speed in ``stop_s``.

    A timed velocity takes profiles by times only, its run time counts from reaching its speed, and it slows down
    at the rate at which it stops (WMX3 API reference, Velocity::StartVel).
    """
    change = (speed_radps - now_radps) * min(1.0, lifetime_s / within_s)
    target = now_radps + change or math.copysign(_SLOWEST_RADPS, speed_radps)
    taken_s = min(within_s, lifetime_s)
    falls = abs(now_radps) if now_radps * target < 0.0 else max(abs(now_radps) - abs(target), 0.0)
    # To rest in stop_s, or harder if slowing down to its speed within the time requires it.
    dec_s = min(stop_s, taken_s * abs(target) / falls) if falls else stop_s
    return Velocity_TimedVelCommand(
        axis,
        max(1e3 * (lifetime_s - taken_s), _SHORTEST_MS),
        Profile.SetupTimeAccTrapezoidal(target, max(1e3 * taken_s, _SHORTEST_MS), max(1e3 * dec_s, _SHORTEST_MS)),
    )
