"""Parameters of the simulated engine: the vendor's blocks, and the rows of the kernel that follow from them."""

from __future__ import annotations

import math
from dataclasses import replace

from robot_stack.wmx.api.enums import (
    Config_FollowingErrorAlarmType,
    Config_LimitSwitchType,
    Config_VelocityFollowingErrorAlarmType,
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
from robot_stack.wmx.config import EngineConfig
from robot_stack.wmx.engine_server import rows
from robot_stack.wmx.engine_server.parameter_checks import gear_in_range, valid_block, valid_emergency_stop
from robot_stack.wmx.engine_server.state import EngineArrays
from robot_stack.wmx.parameter_blocks import AxisBlock, blocks_of, emergency_stop_of, mode_of


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
        start = self._config.parameters
        kinds = start.axes
        self._axes = [blocks_of(kind) for kind in kinds]
        self.gear = [(kind.gear_numerator, kind.gear_denominator) for kind in kinds]
        self.polarity = [kind.polarity for kind in kinds]
        self._absolute = [kind.absolute_encoder for kind in kinds]
        self.emergency_stop = emergency_stop_of(start)
        for axis, kind in enumerate(kinds):
            self._a.flags[Flag.COMMAND_MODE, axis] = mode_of(kind)
            self._a.reals[Real.HOME_OFFSET, axis] = kind.home_offset_rad
            self._apply(axis)

    def absolute(self, axis: int) -> bool:
        """True if the drive has an absolute position, without homing."""
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
        if not valid_emergency_stop(block, self._a.n_axes, self._config.n_input_bytes):
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
        soft = block.softLimitType
        work[rows.SOFT_POSITIVE_TYPE] = block.positiveSoftLimitType if soft == separate else soft
        work[rows.SOFT_NEGATIVE_TYPE] = block.negativeSoftLimitType if soft == separate else soft

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


def _cycles(milliseconds: float, cycle_s: float) -> int:
    return math.ceil(1e-3 * milliseconds / cycle_s - 1e-9)
