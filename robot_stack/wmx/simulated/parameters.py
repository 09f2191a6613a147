"""Parameters of the simulated engine: the vendor's blocks, and the rows of the kernel that follow from them."""

from __future__ import annotations

import math
from dataclasses import asdict, fields, replace
from typing import Any, Final, TypeVar

from robot_stack.wmx.api.enums import (
    AxisCommandMode,
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
from robot_stack.wmx.api.errors import CoreMotionErrorCode, ErrorCode
from robot_stack.wmx.api.parameters import (
    Config_AlarmParam,
    Config_EmergencyStopParam,
    Config_FeedbackParam,
    Config_HomeParam,
    Config_LimitParam,
    Config_MotionParam,
)
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.config import AxisKind, EngineConfig, Homing
from robot_stack.wmx.simulated import rows
from robot_stack.wmx.simulated.checks import LARGEST, SMALLEST
from robot_stack.wmx.simulated.state import EngineArrays

GEAR_SMALLEST: Final = 1e-6
GEAR_LARGEST: Final = 2147483647.0

AxisBlock = Config_FeedbackParam | Config_HomeParam | Config_LimitParam | Config_MotionParam | Config_AlarmParam
BlockT = TypeVar("BlockT")

LIMIT_ACTIONS: Final = {
    "none": Config_LimitSwitchType.PyNone,
    "servo_off": Config_LimitSwitchType.ServoOff,
    "dec_servo_off": Config_LimitSwitchType.DecServoOff,
    "dec": Config_LimitSwitchType.Dec,
    "slow_dec_servo_off": Config_LimitSwitchType.SlowDecServoOff,
    "slow_dec": Config_LimitSwitchType.SlowDec,
}
"""By their names in the engine's configuration."""

BLOCKS: Final[dict[str, type[AxisBlock]]] = {
    "feedback": Config_FeedbackParam,
    "home": Config_HomeParam,
    "limit": Config_LimitParam,
    "motion": Config_MotionParam,
    "alarm": Config_AlarmParam,
}
"""Names of the parameter blocks that exist once per axis."""


class Parameters:
    """Blocks per axis and the emergency-stop block; ``reset`` brings back the configuration."""

    def __init__(self, config: EngineConfig, arrays: EngineArrays) -> None:
        self._config = config
        self._a = arrays
        self._axes: list[dict[str, AxisBlock]] = []
        self.gear: list[tuple[float, float]] = []
        self.polarity: list[int] = []
        self._absolute: list[bool] = []
        self.emergency_stop = Config_EmergencyStopParam()
        self.reset()

    def reset(self) -> None:
        """The configuration's values for every axis."""
        kinds = [self._config.axis_kind(axis) for axis in range(self._config.n_axes)]
        self._axes = [_blocks(kind) for kind in kinds]
        self.gear = [(kind.gear_numerator, kind.gear_denominator) for kind in kinds]
        self.polarity = [kind.polarity for kind in kinds]
        self._absolute = [kind.absolute_encoder for kind in kinds]
        self.emergency_stop = _emergency_stop(self._config, kinds)
        for axis, kind in enumerate(kinds):
            velocity = kind.mode == "velocity"
            self._a.flags[Flag.COMMAND_MODE, axis] = AxisCommandMode.Velocity if velocity else AxisCommandMode.Position
            self._a.reals[Real.HOME_OFFSET, axis] = kind.home_offset_rad
            self._apply(axis)

    def absolute(self, axis: int) -> bool:
        """The drive knows its position without homing."""
        return self._absolute[axis]

    def set_absolute(self, axis: int, absolute: bool) -> None:
        self._absolute[axis] = absolute

    def get(self, name: str, axis: int) -> AxisBlock:
        """A copy of one block of one axis."""
        return replace(self._axes[axis][name])

    def home(self, axis: int) -> Config_HomeParam:
        block = self._axes[axis]["home"]
        assert isinstance(block, Config_HomeParam)
        return block

    def set(self, name: str, axis: int, block: AxisBlock) -> int:
        """Checks and takes over one block of one axis."""
        if not valid_block(name, block):
            return CoreMotionErrorCode.ParameterSettingsInvalid
        self._axes[axis][name] = replace(block)
        self._apply(axis)
        return ErrorCode.PyNone

    def set_emergency_stop(self, block: Config_EmergencyStopParam) -> int:
        """Checks and takes over the emergency-stop block."""
        good = (
            len(block.eStopDec) == self._a.n_axes
            and _are_flags(block.enableEStopSignal, block.invertEStopSignalPolarity)
            and all(_within(dec) for dec in block.eStopDec)
            and block.eStopSignalSource == Config_EStopSignalSource.Input
            and _is_member(EStopLevel, block.eStopSignalLevel)
            and _is_member(Config_EStopLevel1Type, block.eStopLevel1Type)
            and 0 <= block.eStopSignalByteAddress < self._config.n_input_bytes
            and 0 <= block.eStopSignalBitAddress < 8
        )
        if not good:
            return CoreMotionErrorCode.ParameterSettingsInvalid
        self.emergency_stop = replace(block, eStopDec=list(block.eStopDec))
        for axis in range(self._a.n_axes):
            self._apply(axis)
        return ErrorCode.PyNone

    def set_gear(self, axis: int, numerator: float, denominator: float) -> int:
        """Checks and takes over a gear ratio."""
        if not (gear_in_range(numerator) and gear_in_range(denominator)):
            return ErrorCode.ArgumentOutOfRange
        self.gear[axis] = (numerator, denominator)
        self._apply(axis)
        return ErrorCode.PyNone

    def set_polarity(self, axis: int, polarity: int) -> int:
        """Checks and takes over a polarity, 1 or -1."""
        if polarity not in (1, -1):
            return ErrorCode.ArgumentOutOfRange
        self.polarity[axis] = polarity
        self._apply(axis)
        return ErrorCode.PyNone

    def _apply(self, axis: int) -> None:
        params, work = self._a.params[:, axis], self._a.work[:, axis]
        numerator, denominator = self.gear[axis]
        params[rows.COUNTS_PER_UNIT] = self.polarity[axis] * numerator / denominator
        params[rows.ESTOP_DEC] = self.emergency_stop.eStopDec[axis]
        cycle_s = self._config.cycle_time_s
        for block in self._axes[axis].values():
            match block:
                case Config_FeedbackParam():
                    params[rows.IN_POS_WIDTH] = block.inPosWidth
                    params[rows.POS_SET_WIDTH] = block.posSetWidth
                    params[rows.DELAYED_POS_SET_WIDTH] = block.delayedPosSetWidth
                    work[rows.DELAYED_POS_SET_CYCLES] = _cycles(block.delayedPosSetMilliseconds, cycle_s)
                case Config_HomeParam():
                    work[rows.UNHOME_ON_SERVO_OFF] = block.clearHomeDoneOnServoOff
                    work[rows.HS_INVERT] = block.invertHSPolarity
                case Config_LimitParam():
                    self._apply_limit(axis, block)
                    params[rows.SOFT_POSITIVE] = block.softLimitPositivePos
                    params[rows.SOFT_NEGATIVE] = block.softLimitNegativePos
                    params[rows.LS_DEC] = block.lsDec
                    params[rows.LS_SLOW_DEC] = block.lsSlowDec
                case Config_MotionParam():
                    params[rows.QUICK_STOP_DEC] = block.quickStopDec
                    work[rows.OVERTRAVEL] = block.prohibitOvertravel
                case Config_AlarmParam():
                    self._apply_alarm(axis, block)

    def _apply_limit(self, axis: int, block: Config_LimitParam) -> None:
        work = self._a.work[:, axis]
        separate = Config_LimitSwitchType.SeparatePositiveLSNegativeLS
        soft, hard = block.softLimitType, block.lsType
        work[rows.SOFT_POSITIVE_TYPE] = block.positiveSoftLimitType if soft == separate else soft
        work[rows.SOFT_NEGATIVE_TYPE] = block.negativeSoftLimitType if soft == separate else soft
        work[rows.LS_POSITIVE_TYPE] = block.positiveLSType if hard == separate else hard
        work[rows.LS_NEGATIVE_TYPE] = block.negativeLSType if hard == separate else hard
        work[rows.LS_INVERT_POSITIVE] = block.invertPositiveLSPolarity
        work[rows.LS_INVERT_NEGATIVE] = block.invertNegativeLSPolarity
        work[rows.LS_REVERSED] = block.lsDirection == Config_LimitSwitchDirection.Reverse

    def _apply_alarm(self, axis: int, block: Config_AlarmParam) -> None:
        params, work = self._a.params[:, axis], self._a.work[:, axis]
        cycle_s = self._config.cycle_time_s
        params[rows.ERROR_MOVING] = block.followingErrorMoving
        params[rows.ERROR_STOPPED] = block.followingErrorStopped
        params[rows.VELOCITY_ERROR_MOVING] = block.velocityFollowingErrorMoving
        params[rows.VELOCITY_ERROR_STOPPED] = block.velocityFollowingErrorStopped
        work[rows.ERROR_STOPS] = block.followingErrorType == Config_FollowingErrorAlarmType.QuickStop
        work[rows.VELOCITY_ERROR_STOPS] = (
            block.velocityFollowingErrorType == Config_VelocityFollowingErrorAlarmType.QuickStop
        )
        work[rows.VELOCITY_ERROR_MOVING_CYCLES] = _cycles(block.velocityFollowingErrorMovingMilliseconds, cycle_s)
        work[rows.VELOCITY_ERROR_STOPPED_CYCLES] = _cycles(block.velocityFollowingErrorStoppedMilliseconds, cycle_s)
        work[rows.SERVO_OFF_ON_ALARM] = block.servoOffDuringAmpAlarm


def to_wire(block: Any) -> dict[str, Any]:
    """A block as plain names and values."""
    return asdict(block)


def from_wire(kind: type[BlockT], data: object) -> BlockT | None:
    """A block from plain names and values; None if a name is missing or unknown or a value is of the wrong type."""
    if not isinstance(data, dict):
        return None
    defaults = kind()
    names = [item.name for item in fields(defaults)]  # type: ignore[arg-type]
    if set(data) != set(names):
        return None
    try:
        return kind(**{name: _like(data[name], getattr(defaults, name)) for name in names})
    except (TypeError, OverflowError):
        return None


def _like(value: object, like: object) -> object:
    """``value`` as the type of ``like``. Raises TypeError or OverflowError."""
    if isinstance(like, bool):
        if isinstance(value, bool):
            return value
    elif isinstance(like, list):
        if isinstance(value, list):
            return [_like(item, 0.0) for item in value]
    elif isinstance(value, int | float) and not isinstance(value, bool):
        if isinstance(like, float):
            return float(value)
        if isinstance(value, int):
            return value
    raise TypeError(f"{value!r} is not of type {type(like).__name__}")


def _cycles(milliseconds: float, cycle_s: float) -> int:
    return math.ceil(1e-3 * milliseconds / cycle_s - 1e-9)


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


def _blocks(kind: AxisKind) -> dict[str, AxisBlock]:
    error, limits = kind.following_error, kind.soft_limits
    milliseconds = 1e3 * error.velocity_time_s
    alarm = Config_AlarmParam(
        followingErrorStopped=error.stopped_rad,
        followingErrorMoving=error.moving_rad,
        followingErrorType=Config_FollowingErrorAlarmType(int(error.quick_stop)),
        velocityFollowingErrorStopped=error.velocity_stopped_radps,
        velocityFollowingErrorStoppedMilliseconds=milliseconds,
        velocityFollowingErrorMoving=error.velocity_moving_radps,
        velocityFollowingErrorMovingMilliseconds=milliseconds,
        velocityFollowingErrorType=Config_VelocityFollowingErrorAlarmType(int(error.quick_stop)),
        servoOffDuringAmpAlarm=kind.servo_off_during_alarm,
    )
    limit = Config_LimitParam()
    if limits is not None:
        limit = Config_LimitParam(
            softLimitType=Config_LimitSwitchType.Dec,
            softLimitPositivePos=limits.positive_rad,
            softLimitNegativePos=limits.negative_rad,
            lsDec=limits.dec_radps2,
            lsSlowDec=limits.dec_radps2,
        )
    switches = kind.limit_switches
    if switches is not None:
        limit.lsType = LIMIT_ACTIONS[switches.action]
        limit.lsDec, limit.lsSlowDec = switches.dec_radps2, switches.slow_dec_radps2
    return {
        "feedback": Config_FeedbackParam(
            inPosWidth=kind.in_pos_width_rad,
            posSetWidth=kind.pos_set_width_rad,
            delayedPosSetWidth=kind.pos_set_width_rad,
        ),
        "home": _home(kind.homing),
        "limit": limit,
        "motion": Config_MotionParam(quickStopDec=kind.quick_stop_dec_radps2),
        "alarm": alarm,
    }


def _home(homing: Homing | None) -> Config_HomeParam:
    if homing is None:
        return Config_HomeParam()
    acc = homing.acceleration_radps2
    return Config_HomeParam(
        homingVelocitySlow=homing.slow_radps,
        homingVelocitySlowAcc=acc,
        homingVelocitySlowDec=acc,
        homingVelocityFast=homing.fast_radps,
        homingVelocityFastAcc=acc,
        homingVelocityFastDec=acc,
        homeShiftVelocity=homing.slow_radps,
        homeShiftAcc=acc,
        homeShiftDec=acc,
    )


def _emergency_stop(config: EngineConfig, kinds: list[AxisKind]) -> Config_EmergencyStopParam:
    signal = config.estop_signal
    return Config_EmergencyStopParam(
        eStopDec=[kind.estop_dec_radps2 for kind in kinds],
        enableEStopSignal=signal.enabled,
        eStopSignalLevel=EStopLevel.Level1 if signal.level == "level1" else EStopLevel.Final,
        invertEStopSignalPolarity=signal.active == 0,
        eStopSignalByteAddress=signal.byte,
        eStopSignalBitAddress=signal.bit,
        eStopLevel1Type=Config_EStopLevel1Type(int(config.estop_servo_off)),
    )
