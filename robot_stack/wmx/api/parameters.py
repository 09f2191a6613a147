"""Parameter blocks of an axis and of the system, by the vendor's names.

They hold the fields that the simulated engine honours; the vendor's blocks have more, and the vendor adapter passes
those through untouched. Defaults are the vendor's, some of them absurd for an axis in radians: a robot's configuration
sets them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

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


@dataclass(slots=True)
class Config_FeedbackParam:
    """Widths (user units) within which feedback counts as arrived."""

    inPosWidth: float = 1000.0
    posSetWidth: float = 1000.0
    delayedPosSetWidth: float = 1000.0
    delayedPosSetMilliseconds: float = 0.0


@dataclass(slots=True)
class Config_HomeParam:
    """Parameters of homing. Speeds in user units per second, all above zero.

    ``homeShiftDistance`` counts in the homing direction. ``maxLSReverseDistance`` and ``maxHSOnAtStartReverseDistance``
    of 0 set no limit.
    """

    homeType: int = Config_HomeType.CurrentPos
    homeDirection: int = Config_HomeDirection.Positive
    homingVelocitySlow: float = 10000.0
    homingVelocitySlowAcc: float = 10000.0
    homingVelocitySlowDec: float = 10000.0
    homingVelocityFast: float = 10000.0
    homingVelocityFastAcc: float = 10000.0
    homingVelocityFastDec: float = 10000.0
    homingReverseDistance: float = 0.0
    homeShiftVelocity: float = 10000.0
    homeShiftAcc: float = 10000.0
    homeShiftDec: float = 10000.0
    homeShiftDistance: float = 0.0
    invertHSPolarity: bool = False
    maxHSOnAtStartReverseDistance: float = 0.0
    maxLSReverseDistance: float = 0.0
    homePosition: float = 0.0
    clearHomeDoneOnServoOff: bool = False
    clearHomeDoneOnCommStop: bool = True


@dataclass(slots=True)
class Config_LimitParam:
    """Limit switches of the drive (``lsType``) and limits of the position (``softLimitType``).

    The types of the single directions count where the common one is SeparatePositiveLSNegativeLS. Soft limits act only
    on a homed axis and only if the position is not zero.
    """

    lsType: int = Config_LimitSwitchType.PyNone
    positiveLSType: int = Config_LimitSwitchType.PyNone
    negativeLSType: int = Config_LimitSwitchType.PyNone
    invertPositiveLSPolarity: bool = False
    invertNegativeLSPolarity: bool = False
    softLimitType: int = Config_LimitSwitchType.PyNone
    positiveSoftLimitType: int = Config_LimitSwitchType.PyNone
    negativeSoftLimitType: int = Config_LimitSwitchType.PyNone
    softLimitPositivePos: float = 0.0
    softLimitNegativePos: float = 0.0
    lsDec: float = 10000.0
    lsSlowDec: float = 10000.0
    lsDirection: int = Config_LimitSwitchDirection.Normal


@dataclass(slots=True)
class Config_MotionParam:
    """``interruptedIntplUseQuickStop``: an interrupted interpolation stops each axis by itself, not along the path."""

    quickStopDec: float = 100000.0
    prohibitOvertravel: int = Config_ProhibitOvertravelType.ChangeDeceleration
    interruptedIntplUseQuickStop: bool = False


@dataclass(slots=True)
class Config_AlarmParam:
    """Following errors: 0 switches a check off. Widths in user units (per second for the velocity)."""

    followingErrorStopped: float = 0.0
    followingErrorMoving: float = 0.0
    followingErrorType: int = Config_FollowingErrorAlarmType.NoAction
    velocityFollowingErrorStopped: float = 0.0
    velocityFollowingErrorStoppedMilliseconds: float = 0.0
    velocityFollowingErrorMoving: float = 0.0
    velocityFollowingErrorMovingMilliseconds: float = 0.0
    velocityFollowingErrorType: int = Config_VelocityFollowingErrorAlarmType.NoAction
    servoOffDuringAmpAlarm: bool = True


@dataclass(slots=True)
class Config_EmergencyStopParam:
    """``eStopDec`` has one entry per axis."""

    eStopDec: list[float] = field(default_factory=list)
    enableEStopSignal: bool = False
    eStopSignalSource: int = Config_EStopSignalSource.Input
    eStopSignalLevel: int = EStopLevel.Level1
    invertEStopSignalPolarity: bool = False
    eStopSignalByteAddress: int = 0
    eStopSignalBitAddress: int = 0
    eStopLevel1Type: int = Config_EStopLevel1Type.Dec


@dataclass(slots=True)
class Config_AxisParam:
    """Axis parameters, one entry per axis."""

    axisCommandMode: list[int] = field(default_factory=list)
    gearRatioNumerator: list[float] = field(default_factory=list)
    gearRatioDenominator: list[float] = field(default_factory=list)
    axisPolarity: list[int] = field(default_factory=list)
    absoluteEncoderMode: list[bool] = field(default_factory=list)
    absoluteEncoderHomeOffset: list[float] = field(default_factory=list)

    def GetAxisCommandMode(self, index: int) -> int:
        return self.axisCommandMode[index]

    def GetGearRatioNumerator(self, index: int) -> float:
        return self.gearRatioNumerator[index]

    def GetGearRatioDenominator(self, index: int) -> float:
        return self.gearRatioDenominator[index]

    def GetAxisPolarity(self, index: int) -> int:
        return self.axisPolarity[index]

    def GetAbsoluteEncoderMode(self, index: int) -> bool:
        return self.absoluteEncoderMode[index]
