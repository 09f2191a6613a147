"""The engine's checks of commands. Each function returns an error code, 0 for success."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.api.enums import ProfileType
from robot_stack.wmx.api.errors import CoreMotionErrorCode, ErrorCode
from robot_stack.wmx.api.values import Profile
from robot_stack.wmx.axes import Flag

Ints = NDArray[np.int64]

SMALLEST: Final = 1e-6
"""Least velocity, acceleration and deceleration of a position motion (vendor's parameter ranges)."""
LARGEST: Final = 274877906943.0
"""2^38 - 1, the greatest of them."""
LARGEST_COUNT: Final = 2.0**53
"""Encoder counts beyond which a float64 position skips counts."""


def axes_in_range(axes: Sequence[int], n_axes: int) -> int:
    """At least one axis, each existing, none twice."""
    if not axes:
        return ErrorCode.AxisCountOutOfRange
    if any(not 0 <= axis < n_axes for axis in axes):
        return ErrorCode.AxisOutOfRange
    return ErrorCode.PyNone if len(set(axes)) == len(axes) else ErrorCode.DuplicateAxis


def towards_limit(flags: Ints, axis: int, direction: float) -> int:
    """No motion further into a limit at which the axis is; ``direction`` is signed, 0 for none."""
    if direction == 0.0:
        return ErrorCode.PyNone
    on = flags[Flag.POSITIVE_SOFT_LIMIT if direction > 0.0 else Flag.NEGATIVE_SOFT_LIMIT, axis]
    return ErrorCode.AxisSoftLimit if on else ErrorCode.PyNone


def _within(value: float) -> bool:
    return SMALLEST <= value <= LARGEST  # False for NaN


def _common(profile: Profile) -> int:
    if profile.type not in (ProfileType.Trapezoidal, ProfileType.TimeAccTrapezoidal):
        return CoreMotionErrorCode.ProfileTypeNotSupported
    if profile.startingVelocity != 0.0:  # NaN differs from zero too
        return CoreMotionErrorCode.StartingVelocityArgumentOutOfRange
    if profile.endVelocity != 0.0:
        return CoreMotionErrorCode.EndVelocityArgumentOutOfRange
    return ErrorCode.PyNone


def _time_in_range(milliseconds: float, *, zero: bool) -> bool:
    return math.isfinite(milliseconds) and (milliseconds > 0.0 or (zero and milliseconds == 0.0))


def position_profile(profile: Profile) -> int:
    """A profile of a position motion."""
    code = _common(profile)
    if code:
        return code
    if not _within(profile.velocity):
        return CoreMotionErrorCode.VelocityArgumentOutOfRange
    if profile.type == ProfileType.TimeAccTrapezoidal:
        times = (profile.accTimeMilliseconds, profile.decTimeMilliseconds)
        good = all(_time_in_range(time, zero=False) for time in times)
        return ErrorCode.PyNone if good else CoreMotionErrorCode.TimeArgumentOutOfRange
    if not _within(profile.acc):
        return CoreMotionErrorCode.AccArgumentOutOfRange
    return ErrorCode.PyNone if _within(profile.dec) else CoreMotionErrorCode.DecArgumentOutOfRange


def velocity_profile(profile: Profile) -> int:
    """A profile of a velocity motion: signed velocity, zero included; a rate or time of 0 is a change in one cycle."""
    code = _common(profile)
    if code:
        return code
    if not abs(profile.velocity) <= LARGEST:
        return CoreMotionErrorCode.VelocityArgumentOutOfRange
    if profile.type == ProfileType.TimeAccTrapezoidal:
        times = (profile.accTimeMilliseconds, profile.decTimeMilliseconds)
        good = all(_time_in_range(time, zero=True) for time in times)
        return ErrorCode.PyNone if good else CoreMotionErrorCode.TimeArgumentOutOfRange
    if not (profile.acc == 0.0 or _within(profile.acc)):
        return CoreMotionErrorCode.AccArgumentOutOfRange
    good = profile.dec == 0.0 or _within(profile.dec)
    return ErrorCode.PyNone if good else CoreMotionErrorCode.DecArgumentOutOfRange


def target(position: float, counts_per_unit: float, home_offset: float) -> int:
    """A position whose encoder count is exact."""
    good = abs((position + home_offset) * counts_per_unit) < LARGEST_COUNT  # False for NaN
    return ErrorCode.PyNone if good else CoreMotionErrorCode.PositionArgumentOutOfRange


def timed_profile(profile: Profile) -> int:
    """A timed motion takes the kinds by times only (StartVel of timed commands); this engine has one."""
    good = profile.type == ProfileType.TimeAccTrapezoidal
    return ErrorCode.PyNone if good else CoreMotionErrorCode.ProfileTypeNotSupported


def run_time(milliseconds: float) -> int:
    """Checks the duration of a timed motion."""
    good = 0.0 < milliseconds <= LARGEST
    return ErrorCode.PyNone if good else CoreMotionErrorCode.RunTimeArgumentOutOfRange
