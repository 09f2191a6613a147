"""Velocities that the engine itself ends: the dead-man of every client that turns axes.

The engine stops an axis at the end of a timed velocity unless another command arrives, even if the client has died
(WMX3 API reference, Velocity::StartVel of a TimedVelCommand). It accepts only profiles by times; its run time counts
from when the velocity is reached, and it slows down at the rate at which it stops. The engine's watchdog is no
dead-man: a library thread feeds it, and its timeout closes the device without stopping an axis
(page_WMXDOC_FUNC_WATCHDOG_BASIC).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from robot_stack.wmx.api import CoreMotion, Profile, Velocity_TimedVelCommand, Velocity_VelCommand

# A time of zero would be a step; the engine's cycle is this long.
_SHORTEST_MS: Final = 1.0


def by_times(velocity: float, growth_s: float, rest_s: float) -> Profile:
    """A velocity (user units per second) that is reached in ``growth_s``, and left for rest in ``rest_s``."""
    return Profile.SetupTimeAccTrapezoidal(velocity, max(1e3 * growth_s, _SHORTEST_MS), max(1e3 * rest_s, _SHORTEST_MS))


def timed(axis: int, profile: Profile, run_s: float) -> Velocity_TimedVelCommand:
    """A velocity that ends after ``run_s`` at it."""
    return Velocity_TimedVelCommand(axis, max(1e3 * run_s, _SHORTEST_MS), profile)


def speed_change(now: float, target: float) -> tuple[float, float]:
    """By how much a speed grows and by how much it falls: through zero it falls first and then grows."""
    if now * target < 0.0:
        return abs(target), abs(now)
    return max(abs(target) - abs(now), 0.0), max(abs(now) - abs(target), 0.0)


def start(core: CoreMotion, resting: Sequence[Velocity_VelCommand], turning: Sequence[Velocity_TimedVelCommand]) -> int:
    """Commands axes to rest first, in a separate call, then the turning ones; returns the engine's code. An axis at
    rest needs no end.
    """
    code = core.velocity.StartVel(len(resting), resting) if resting else 0
    if code or not turning:
        return code
    return core.velocity.StartVel_TimedVel(len(turning), turning)
