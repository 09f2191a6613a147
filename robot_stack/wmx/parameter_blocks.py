"""Parameter blocks of an axis by name, made of the configuration's values; and all entries of a parameter file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from robot_stack.wmx.api import surface
from robot_stack.wmx.api.enums import (
    AxisCommandMode,
    Config_EStopLevel1Type,
    Config_FollowingErrorAlarmType,
    Config_HomeDirection,
    Config_HomeType,
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
from robot_stack.wmx.config import AxisKind, EngineParameters, Homing
from robot_stack.wmx.simulated import parameter_layout as layout
from robot_stack.wmx.simulated.parameter_file import ParameterValues

Entries = dict[str, layout.Number]
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


HOME_TYPES: Final = {"current_position": Config_HomeType.CurrentPos, "home_switch": Config_HomeType.HS}
"""By their names in the configuration."""


def _home(homing: Homing | None) -> Config_HomeParam:
    if homing is None:
        return Config_HomeParam()
    acc = homing.acceleration_radps2
    positive = homing.direction == "positive"
    return Config_HomeParam(
        homeType=HOME_TYPES[homing.type],
        homeDirection=Config_HomeDirection.Positive if positive else Config_HomeDirection.Negative,
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


def emergency_stop_of(parameters: EngineParameters) -> Config_EmergencyStopParam:
    """The emergency-stop block; ``eStopDec`` has the axes of ``parameters``."""
    block = Config_EmergencyStopParam(
        eStopDec=[kind.estop_dec_radps2 for kind in parameters.axes],
        eStopLevel1Type=Config_EStopLevel1Type(int(parameters.estop_servo_off)),
    )
    signal = parameters.estop_signal
    if signal is not None:
        block.enableEStopSignal = signal.enabled
        block.eStopSignalLevel = EStopLevel.Level1 if signal.level == "level1" else EStopLevel.Final
        block.invertEStopSignalPolarity = signal.active == 0
        block.eStopSignalByteAddress, block.eStopSignalBitAddress = signal.byte, signal.bit
    return block


def mode_of(kind: AxisKind) -> AxisCommandMode:
    """The command mode of an axis of this kind."""
    return AxisCommandMode.Velocity if kind.mode == "velocity" else AxisCommandMode.Position


# --- the parameter file ----------------------------------------------------------------------------------------------


def file_values(parameters: EngineParameters) -> ParameterValues:
    """All entries of a parameter file; those that no parameter sets have the vendor's defaults."""
    stop = emergency_stop_of(parameters)
    return ParameterValues(
        list(engine_entries(stop, layout.GLOBAL_ENTRIES).values()),
        [list(_entries_of_kind(kind).values()) for kind in parameters.axes],
    )


def _entries_of_kind(kind: AxisKind) -> Entries:
    entries = dict(layout.AXIS_ENTRIES)
    fill_blocks(entries, blocks_of(kind))
    for key in layout.FURTHER_IN_POS_WIDTHS:
        entries[key] = kind.in_pos_width_rad
    entries[layout.ESTOP_DEC] = kind.estop_dec_radps2
    entries[layout.COMMAND_MODE] = int(mode_of(kind))
    entries[layout.GEAR_NUMERATOR], entries[layout.GEAR_DENOMINATOR] = kind.gear_numerator, kind.gear_denominator
    entries[layout.POLARITY] = kind.polarity
    entries[layout.ABSOLUTE_ENCODER] = int(kind.absolute_encoder)
    entries[layout.HOME_OFFSET] = kind.home_offset_rad if kind.absolute_encoder else 0.0
    return entries


def engine_entries(stop: Config_EmergencyStopParam, others: Mapping[str, layout.Number]) -> Entries:
    """The engine's entries: ``others``, with the emergency stop of ``stop``."""
    entries = dict(others)
    _fill(entries, layout.EMERGENCY_STOP_FIELDS, stop)
    return entries


def fill_blocks(entries: Entries, blocks: Mapping[str, AxisBlock]) -> None:
    """Sets an axis' entries from its blocks."""
    for name, names in layout.BLOCK_FIELDS.items():
        _fill(entries, names, blocks[name])


def _fill(entries: Entries, names: Mapping[str, str], block: Any) -> None:
    for key, name in names.items():
        value = getattr(block, name)
        entries[key] = float(value) if isinstance(value, float) else int(value)
