"""The parameter blocks of an axis: by name, and as the configuration sets them."""

from __future__ import annotations

from typing import Final

from robot_stack.wmx.api import surface
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


def block_name(name: str) -> str:
    """The short name of a block of the surface."""
    return name.removesuffix("Param").lower()


BLOCKS: Final[dict[str, type[AxisBlock]]] = {block_name(name): kind for name, kind in surface.BLOCKS.items()}
"""The parameter blocks that exist once per axis, by their short names: feedback, home, limit, motion, alarm."""

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
