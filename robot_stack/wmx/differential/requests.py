"""Requests of the session for one axis of the engine."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import Velocity_TimedVelCommand, Velocity_VelCommand
from robot_stack.wmx.timed_velocity import by_times, speed_change, timed

Request = Callable[[MotionEngine], int]
# A timed velocity of zero would be a rest with an end.
_SLOWEST_RADPS: Final = 1e-3


def quick_stop(axis: int) -> Request:
    """Tries the quick stops of both modes: the engine rejects that of the other mode."""

    def request(engine: MotionEngine) -> int:
        return engine.core_motion.velocity.ExecQuickStop(axis) and engine.core_motion.motion.ExecQuickStop(axis)

    return request


def rest(axis: int, within_s: float) -> Velocity_VelCommand:
    """To standstill within a time. It needs no timeout."""
    return Velocity_VelCommand(axis, by_times(0.0, within_s, within_s))


def run_at(
    axis: int, now_radps: float, speed_radps: float, within_s: float, stop_s: float, lifetime_s: float
) -> Velocity_TimedVelCommand:
    """From the present to another speed within a time, limited by the lifetime of a command; after that the engine
    stops the axis, from its speed in ``stop_s``.
    """
    within_life = (speed_radps - now_radps) * min(1.0, lifetime_s / within_s)
    target = now_radps + within_life or math.copysign(_SLOWEST_RADPS, speed_radps)
    taken_s = min(within_s, lifetime_s)
    _, falls = speed_change(now_radps, target)
    # To rest in stop_s, or harder if slowing down to its speed within the time requires it.
    dec_s = min(stop_s, taken_s * abs(target) / falls) if falls else stop_s
    return timed(axis, by_times(target, taken_s, dec_s), lifetime_s - taken_s)
