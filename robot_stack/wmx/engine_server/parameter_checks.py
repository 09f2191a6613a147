"""Checks of parameter values."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Final

from robot_stack.wmx.api.enums import (
    Config_EStopLevel1Type,
    Config_EStopSignalSource,
    Config_FollowingErrorAlarmType,
    Config_HomeDirection,
    Config_HomeType,
    Config_LimitSwitchDirection,
    Config_LimitSwitchType,
    Config_ProhibitOvertravelType,
    Config_VelocityFollowingErrorAlarmType,
    EStopLevel,
)
from robot_stack.wmx.api.parameters import (
    Config_AlarmParam,
    Config_EmergencyStopParam,
    Config_FeedbackParam,
    Config_HomeParam,
    Config_LimitParam,
    Config_MotionParam,
)
from robot_stack.wmx.engine_server.checks import LARGEST, SMALLEST
from robot_stack.wmx.parameter_blocks import BLOCKS, AxisBlock

GEAR_SMALLEST: Final = 1e-6
GEAR_LARGEST: Final = 2147483647.0


def gear_in_range(value: float) -> bool:
    """A numerator or denominator that the vendor takes too."""
    return GEAR_SMALLEST <= value <= GEAR_LARGEST


def _within(value: float) -> bool:
    return SMALLEST <= value <= LARGEST


def _are_flags(*values: object) -> bool:
    return all(isinstance(value, bool) for value in values)


def _is_member(kind: Any, value: int) -> bool:
    return value in [int(member) for member in kind]


def valid_block(name: str, block: AxisBlock) -> bool:
    """Every field of the block named ``name`` is in its range."""
    reals = [value for value in asdict(block).values() if isinstance(value, float)]
    if not isinstance(block, BLOCKS[name]) or not all(abs(value) <= LARGEST for value in reals):
        return False
    match block:
        case Config_FeedbackParam():
            return all(value >= 0.0 for value in reals)
        case Config_HomeParam():
            return _valid_home(block)
        case Config_LimitParam():
            return _valid_limit(block)
        case Config_MotionParam():
            return (
                _within(block.quickStopDec)
                and _is_member(Config_ProhibitOvertravelType, block.prohibitOvertravel)
                and _are_flags(block.interruptedIntplUseQuickStop)
            )
        case Config_AlarmParam():
            return (
                all(value >= 0.0 for value in reals)
                and _is_member(Config_FollowingErrorAlarmType, block.followingErrorType)
                and _is_member(Config_VelocityFollowingErrorAlarmType, block.velocityFollowingErrorType)
                and _are_flags(block.servoOffDuringAmpAlarm)
            )


def _valid_home(block: Config_HomeParam) -> bool:
    speeds = (
        *(block.homingVelocitySlow, block.homingVelocitySlowAcc, block.homingVelocitySlowDec),
        *(block.homingVelocityFast, block.homingVelocityFastAcc, block.homingVelocityFastDec),
        *(block.homeShiftVelocity, block.homeShiftAcc, block.homeShiftDec),
    )
    distances = (block.homingReverseDistance, block.maxHSOnAtStartReverseDistance, block.maxLSReverseDistance)
    return (
        _is_member(Config_HomeType, block.homeType)
        and _is_member(Config_HomeDirection, block.homeDirection)
        and all(_within(speed) for speed in speeds)
        and all(distance >= 0.0 for distance in distances)
        and _are_flags(block.invertHSPolarity, block.clearHomeDoneOnServoOff, block.clearHomeDoneOnCommStop)
    )


def _valid_limit(block: Config_LimitParam) -> bool:
    common = (block.lsType, block.softLimitType)
    single = (block.positiveLSType, block.negativeLSType, block.positiveSoftLimitType, block.negativeSoftLimitType)
    separate = Config_LimitSwitchType.SeparatePositiveLSNegativeLS
    return (
        all(_is_member(Config_LimitSwitchType, kind) for kind in (*common, *single))
        and separate not in single
        and _is_member(Config_LimitSwitchDirection, block.lsDirection)
        and _are_flags(block.invertPositiveLSPolarity, block.invertNegativeLSPolarity)
        and _within(block.lsDec)
        and _within(block.lsSlowDec)
    )


def valid_emergency_stop(block: Config_EmergencyStopParam, n_axes: int, n_input_bytes: int) -> bool:
    """Every field of the emergency-stop block is in its range for an engine of that size."""
    return (
        len(block.eStopDec) == n_axes
        and _are_flags(block.enableEStopSignal, block.invertEStopSignalPolarity)
        and all(_within(dec) for dec in block.eStopDec)
        and block.eStopSignalSource == Config_EStopSignalSource.Input
        and _is_member(EStopLevel, block.eStopSignalLevel)
        and _is_member(Config_EStopLevel1Type, block.eStopLevel1Type)
        and 0 <= block.eStopSignalByteAddress < n_input_bytes
        and 0 <= block.eStopSignalBitAddress < 8
    )
