"""The vendor's status records as published, and the simulated engine's status in these records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from robot_stack.wmx.api import (
    AxisCommandMode,
    DetailOperationState,
    EngineState,
    EStopLevel,
    HomeError,
    HomeState,
    OperationState,
)
from robot_stack.wmx.axes import Flag, Real, StatusSnapshot


@dataclass(slots=True)
class CoreMotionAxisStatus:
    """One axis."""

    servoOn: bool = False
    servoOffline: bool = True
    ampAlarm: bool = False
    ampAlarmCode: int = 0
    followingErrorAlarm: bool = False
    posCmd: float = 0.0
    actualPos: float = 0.0
    velocityCmd: float = 0.0
    actualVelocity: float = 0.0
    torqueCmd: float = 0.0
    actualTorque: float = 0.0
    actualFollowingError: float = 0.0
    encoderCommand: int = 0
    encoderFeedback: int = 0
    opState: int = OperationState.Idle
    detailOpState: int = DetailOperationState.Idle
    axisCommandMode: int = AxisCommandMode.Position
    commandReady: bool = False
    motionComplete: bool = False
    motionPaused: bool = False
    inPos: bool = False
    cmdDistributionEnd: bool = False
    posSet: bool = False
    delayedPosSet: bool = False
    profileTargetPos: float = 0.0
    profileRemainingMilliseconds: float = 0.0
    cmdAcc: float = 0.0
    accFlag: bool = False
    decFlag: bool = False
    positiveLS: bool = False
    negativeLS: bool = False
    positiveSoftLimit: bool = False
    negativeSoftLimit: bool = False
    homeState: int = HomeState.Idle
    homeError: int = HomeError.NoError
    homeDone: bool = False
    homeSwitch: bool = False
    homeOffset: float = 0.0


@dataclass(slots=True)
class CoreMotionStatus:
    """The whole engine. ``axesStatus`` holds one record per axis; axes beyond it are absent and read as offline."""

    invalidLicenseError: bool = False
    engineState: int = EngineState.Unknown
    numOfInterrupts: int = 0
    cycleTimeMilliseconds: list[float] = field(default_factory=lambda: [0.0, 0.0])
    cycleCounter: list[int] = field(default_factory=lambda: [0, 0])
    emergencyStop: bool = False
    emergencyStopLevel: int = EStopLevel.Final
    axesStatus: Sequence[CoreMotionAxisStatus] = ()


FLAG_FIELDS: Final = {
    "servoOn": Flag.SERVO_ON,
    "servoOffline": Flag.SERVO_OFFLINE,
    "ampAlarm": Flag.AMP_ALARM,
    "followingErrorAlarm": Flag.FOLLOWING_ERROR_ALARM,
    "commandReady": Flag.COMMAND_READY,
    "motionComplete": Flag.MOTION_COMPLETE,
    "inPos": Flag.IN_POS,
    "cmdDistributionEnd": Flag.CMD_DISTRIBUTION_END,
    "posSet": Flag.POS_SET,
    "delayedPosSet": Flag.DELAYED_POS_SET,
    "accFlag": Flag.ACC_FLAG,
    "decFlag": Flag.DEC_FLAG,
    "positiveSoftLimit": Flag.POSITIVE_SOFT_LIMIT,
    "negativeSoftLimit": Flag.NEGATIVE_SOFT_LIMIT,
    "homeDone": Flag.HOME_DONE,
    "positiveLS": Flag.POSITIVE_LS,
    "negativeLS": Flag.NEGATIVE_LS,
    "homeSwitch": Flag.HOME_SWITCH,
}
CODE_FIELDS: Final = {
    "ampAlarmCode": Flag.AMP_ALARM_CODE,
    "encoderCommand": Flag.ENCODER_COMMAND,
    "encoderFeedback": Flag.ENCODER_FEEDBACK,
    "opState": Flag.OP_STATE,
    "detailOpState": Flag.DETAIL_OP_STATE,
    "axisCommandMode": Flag.COMMAND_MODE,
    "homeState": Flag.HOME_STATE,
    "homeError": Flag.HOME_ERROR,
}
REAL_FIELDS: Final = {
    "posCmd": Real.POS_CMD,
    "actualPos": Real.ACTUAL_POS,
    "velocityCmd": Real.VELOCITY_CMD,
    "actualVelocity": Real.ACTUAL_VELOCITY,
    "actualTorque": Real.ACTUAL_TORQUE,
    "actualFollowingError": Real.FOLLOWING_ERROR,
    "profileTargetPos": Real.PROFILE_TARGET_POS,
    "profileRemainingMilliseconds": Real.PROFILE_REMAINING_MS,
    "cmdAcc": Real.CMD_ACC,
    "homeOffset": Real.HOME_OFFSET,
}


def core_motion_status(snapshot: StatusSnapshot) -> CoreMotionStatus:
    """The vendor's status record of a snapshot."""
    return CoreMotionStatus(
        engineState=snapshot.engine_state,
        numOfInterrupts=1,
        cycleTimeMilliseconds=[1e3 * snapshot.cycle_time_s, 0.0],
        cycleCounter=[snapshot.cycle_counter, 0],
        emergencyStop=snapshot.emergency_stop,
        emergencyStopLevel=snapshot.emergency_stop_level,
        axesStatus=[_axis(snapshot, axis) for axis in range(snapshot.n_axes)],
    )


def _axis(snapshot: StatusSnapshot, axis: int) -> CoreMotionAxisStatus:
    reals, flags = snapshot.reals[:, axis].tolist(), snapshot.flags[:, axis].tolist()
    record = CoreMotionAxisStatus()
    for name, real in REAL_FIELDS.items():
        setattr(record, name, reals[real])
    for name, flag in FLAG_FIELDS.items():
        setattr(record, name, bool(flags[flag]))
    for name, flag in CODE_FIELDS.items():
        setattr(record, name, flags[flag])
    return record
