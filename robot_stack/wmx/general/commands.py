"""A motion message as commands to the engine: all of it is valid, or nothing is commanded."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from robot_stack.wmx.api import (
    MAX_AXES,
    AxisCommandMode,
    Motion_PosCommand,
    OperationState,
    Profile,
    Velocity_TimedVelCommand,
    Velocity_VelCommand,
)
from robot_stack.wmx.axes import Flag, StatusSnapshot
from robot_stack.wmx.general.requests import (
    Refused,
    check_at_most,
    check_axes,
    check_finite,
    check_index,
    check_lengths,
    check_positive,
)
from robot_stack.wmx.timed_velocity import by_times, speed_change, timed

_TRAPEZOIDAL: Final = ("", "trapezoidal")
# A velocity of zero would be rest.
_SLOWEST_RADPS: Final = 1e-6
_STATES: Final = {
    AxisCommandMode.Velocity: (OperationState.Idle, OperationState.Velocity),
    AxisCommandMode.Position: (OperationState.Idle, OperationState.Pos, OperationState.Jog),
}


@dataclass(frozen=True, slots=True)
class AxisOrder:
    """A received message: parallel sequences; ``target`` (rad) is None for a velocity. rad/s, rad/s^2."""

    index: Sequence[int]
    velocity: Sequence[float]
    acc: Sequence[float]
    dec: Sequence[float]
    target: Sequence[float] | None = None


@dataclass(frozen=True, slots=True)
class CommandLimits:
    """Largest magnitudes of commands; 0 for none."""

    velocity_radps: float = 0.0
    acceleration_radps2: float = 0.0


def unknown_profile(profile: str) -> bool:
    """True for a value of the reserved field that is not supported."""
    return profile.strip().lower() not in _TRAPEZOIDAL


def check_order(order: AxisOrder, limits: CommandLimits) -> None:
    """Checks that need only the message. Raises Refused."""
    fields = {"velocity": order.velocity, "acc": order.acc, "dec": order.dec}
    if order.target is not None:
        fields = {"target": order.target, **fields}
    check_index(order.index)
    check_lengths(order.index, fields)
    check_axes(order.index, MAX_AXES)
    check_finite(fields)
    if order.target is not None:
        check_positive("velocity", order.velocity)
    check_positive("acc", order.acc)
    check_positive("dec", order.dec)
    check_at_most("velocity", order.velocity, limits.velocity_radps)
    check_at_most("acc", order.acc, limits.acceleration_radps2)
    check_at_most("dec", order.dec, limits.acceleration_radps2)


def check_ready(index: Sequence[int], mode: AxisCommandMode, snapshot: StatusSnapshot) -> None:
    """Checks that the axes can execute commands now. Raises Refused."""
    check_axes(index, snapshot.n_axes)
    if not snapshot.communicating:
        raise Refused(f"the engine does not communicate with the drives: it is {snapshot.engine_state.name}")
    if snapshot.emergency_stop:
        raise Refused("the engine's emergency stop is active")
    for axis in index:
        trouble = _trouble(axis, mode, snapshot)
        if trouble:
            raise Refused(f"axis {axis} {trouble}")


def velocity_commands(order: AxisOrder) -> list[Velocity_VelCommand]:
    """Commands of a checked order, without an end."""
    return [Velocity_VelCommand(axis, profile) for axis, profile in _profiles(order)]


def timed_velocity_commands(
    order: AxisOrder, snapshot: StatusSnapshot, lifetime_s: float
) -> tuple[list[Velocity_TimedVelCommand], list[Velocity_VelCommand]]:
    """Commands of a checked order: turning axes, which the engine itself slows down again after ``lifetime_s``, and
    standing axes, which need no end. A velocity out of reach within the time is reduced.
    """
    turning, resting = [], []
    for axis, profile in _profiles(order):
        if profile.velocity:
            turning.append(_timed(axis, profile, float(snapshot.velocity_cmd[axis]), lifetime_s))
        else:
            resting.append(Velocity_VelCommand(axis, profile))
    return turning, resting


def _timed(axis: int, wanted: Profile, now: float, lifetime_s: float) -> Velocity_TimedVelCommand:
    """acc and dec of a profile as equivalent times from the present velocity."""
    target = wanted.velocity
    _, falls = speed_change(now, target)
    remaining_s = max(lifetime_s - falls / wanted.dec, 0.0)
    slowest = abs(now) if now * target > 0.0 else 0.0
    speed = min(abs(target), max(slowest, _SLOWEST_RADPS) + wanted.acc * remaining_s)
    growth_s = max(speed - slowest, 0.0) / wanted.acc
    profile = by_times(math.copysign(speed, target), growth_s, speed / wanted.dec)
    return timed(axis, profile, remaining_s - growth_s)


def position_commands(order: AxisOrder) -> list[Motion_PosCommand]:
    """Commands of a checked order with targets."""
    assert order.target is not None
    return [
        Motion_PosCommand(axis, target, profile)
        for (axis, profile), target in zip(_profiles(order), order.target, strict=True)
    ]


def from_present(order: AxisOrder, snapshot: StatusSnapshot) -> AxisOrder | None:
    """A relative order with a moving axis, as an absolute one; None if all of its axes stand.

    The engine counts a relative motion during another from that one's target. The documents specify the present
    position: the commanded one at the time of the order, from which the engine also counts for a standing axis.
    """
    assert order.target is not None
    if not any(snapshot.op_state[axis] for axis in order.index):
        return None
    targets = [float(snapshot.pos_cmd[axis]) + by for axis, by in zip(order.index, order.target, strict=True)]
    return AxisOrder(order.index, order.velocity, order.acc, order.dec, targets)


def _profiles(order: AxisOrder) -> list[tuple[int, Profile]]:
    rows = zip(order.index, order.velocity, order.acc, order.dec, strict=True)
    return [(axis, Profile.SetupTrapezoidal(velocity, acc, dec)) for axis, velocity, acc, dec in rows]


def _trouble(axis: int, mode: AxisCommandMode, snapshot: StatusSnapshot) -> str:
    if snapshot.amp_alarm[axis]:
        return f"has amplifier alarm {int(snapshot.amp_alarm_code[axis])}"
    if snapshot.following_error_alarm[axis]:
        return "has a following error alarm"
    if snapshot.flags[Flag.SERVO_OFFLINE, axis]:
        return "is offline"
    if not snapshot.servo_on[axis]:
        return "has its servo off"
    if snapshot.command_mode[axis] != mode:
        return f"is not in {mode.name.lower()} mode"
    state = int(snapshot.op_state[axis])
    if state not in _STATES[mode]:
        return f"is busy: {_state_name(state)}"
    return ""


def _state_name(state: int) -> str:
    try:
        return OperationState(state).name
    except ValueError:
        return f"operation state {state}"
