"""The parameter blocks of an axis: by name, as the configuration sets them, and on their way to a client."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import Any, Final, TypeVar

from robot_stack.wmx.api.enums import (
    Config_EStopLevel1Type,
    Config_FollowingErrorAlarmType,
    Config_LimitSwitchType,
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
from robot_stack.wmx.config import AxisKind, EngineConfig, Homing

AxisBlock = Config_FeedbackParam | Config_HomeParam | Config_LimitParam | Config_MotionParam | Config_AlarmParam
BlockT = TypeVar("BlockT")

BLOCKS: Final[dict[str, type[AxisBlock]]] = {
    "feedback": Config_FeedbackParam,
    "home": Config_HomeParam,
    "limit": Config_LimitParam,
    "motion": Config_MotionParam,
    "alarm": Config_AlarmParam,
}
"""Names of the parameter blocks that exist once per axis."""

LIMIT_ACTIONS: Final = {
    "none": Config_LimitSwitchType.PyNone,
    "servo_off": Config_LimitSwitchType.ServoOff,
    "dec_servo_off": Config_LimitSwitchType.DecServoOff,
    "dec": Config_LimitSwitchType.Dec,
    "slow_dec_servo_off": Config_LimitSwitchType.SlowDecServoOff,
    "slow_dec": Config_LimitSwitchType.SlowDec,
}
"""By their names in the engine's configuration."""


def blocks_of(kind: AxisKind) -> dict[str, AxisBlock]:
    """The blocks of an axis of this kind, by name."""
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


def emergency_stop_of(config: EngineConfig, kinds: list[AxisKind]) -> Config_EmergencyStopParam:
    """The emergency-stop block of an engine whose axes are of these kinds."""
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
