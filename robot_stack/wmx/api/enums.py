"""Enumerations of the engine, by the vendor's names and numbers."""

from __future__ import annotations

from enum import IntEnum


class DeviceType(IntEnum):
    DeviceTypeNormal = 0
    DeviceTypeLowPriority = 1
    DeviceTypeExitWOCnt = 2
    DeviceTypeLowpriorityExitWOCnt = 3


class EngineState(IntEnum):
    """Idle: process up, nothing initialised. Running: ready, no bus. Communicating: cyclic bus."""

    Idle = 0
    Running = 1
    Communicating = 2
    Shutdown = 3
    Unknown = 4


class OperationState(IntEnum):
    """State of an axis' command; the feedback may still settle in Idle."""

    Idle = 0
    Pos = 1
    Jog = 2
    Home = 3
    Sync = 4
    GantryHome = 5
    Stop = 6
    Intpl = 7
    Velocity = 8
    ConstLinearVelocity = 9
    Trq = 10
    DirectControl = 11
    PVT = 12
    ECAM = 13


class DetailOperationState(IntEnum):
    Idle = 0
    Pos = 200
    Jog = 300
    Home = 400
    Stop = 700
    Stop_QStop = 701
    Stop_EStop = 702
    Intpl = 800
    Intpl_Spline = 804
    Velocity = 900


class AxisCommandMode(IntEnum):
    Position = 0
    Velocity = 1
    Torque = 2


class ProfileType(IntEnum):
    """Only Trapezoidal and TimeAccTrapezoidal are executed by the simulated engine."""

    Trapezoidal = 0
    SCurve = 1
    JerkRatio = 2
    Parabolic = 3
    Sin = 4
    AdvancedS = 5
    TrapezoidalMAT = 6
    JerkLimited = 7
    JerkLimitedSCurve = 8
    JerkLimitedAdvancedS = 9
    TwoVelocityTrapezoidal = 10
    TwoVelocitySCurve = 11
    TwoVelocityJerkRatio = 12
    TimeAccTrapezoidal = 13


class EStopLevel(IntEnum):
    """Final is the higher level: servos off at once. Level1 decelerates first."""

    Final = 0
    Level1 = 1


class HomeState(IntEnum):
    """The present search of a homing motion."""

    Idle = 0
    ZPulseSearch = 1
    ZPulseSearchReverse = 2
    ZPulseSearchPauseReverse = 3
    HSSearch = 4
    HSSearchPause = 5
    HSAndZPulseSearch = 6
    HSAndZPulseSearchPause = 7
    HSOffSearch = 8
    HSOffSearchPause = 9
    HSOffAndZPulseSearch = 10
    HSOffAndZPulseSearchPause = 11
    LSSearch = 12
    LSSearchPause = 13
    HSClearReverse = 14
    HSClearReversePause = 15
    HSFallingEdgeSearchReverse = 16
    HSFallingEdgeSearchReversePause = 17
    LSFallingEdgeSearchReverse = 18
    LSFallingEdgeSearchReversePause = 19
    TouchProbeSearch = 20
    TouchProbeSearchPause = 21
    SecondHSSearch = 22
    SecondHSSearchPause = 23
    SecondTouchProbeSearch = 24
    SecondTouchProbeSearchPause = 25
    MechanicalEndDetection = 26
    HomeShift = 27
    HomeShiftPause = 28
    Cancel = 29


class HomeError(IntEnum):
    """Why the last homing of an axis failed. The vendor's name of 0 is NoError."""

    NoError = 0
    LSTriggered = 1
    MaxLSRevDistanceTraveled = 2
    MaxHSOnAtStartRevDistanceTraveled = 3
    ZPulseDistanceCheckError = 4


class Config_HomeDirection(IntEnum):
    Positive = 0
    Negative = 1


class Config_HomeType(IntEnum):
    CurrentPos = 0
    ZPulse = 1
    HS = 2
    HSHS = 3
    HSZPulse = 4
    HSReverseZPulse = 5
    HSOff = 6
    HSOffZPulse = 7
    HSOffReverseZPulse = 8
    LSReverseZPulse = 9
    NearLSReverseZPulse = 10
    ExternalLSReverseZPulse = 11
    TouchProbe = 12
    HSTouchProbe = 13
    LS = 14
    NearLS = 15
    ExternalLS = 16
    MechanicalEndDetection = 17
    MechanicalEndDetectionHS = 18
    MechanicalEndDetectionLS = 19
    MechanicalEndDetectionReverseZPulse = 20


class Config_LimitSwitchDirection(IntEnum):
    """Reverse: the switch named positive lies in the negative direction and the other way round."""

    Normal = 0
    Reverse = 1


class Config_LimitSwitchType(IntEnum):
    """Effect of a limit on the axis that runs into it."""

    PyNone = 0
    ServoOff = 1
    DecServoOff = 2
    Dec = 3
    SlowDecServoOff = 4
    SlowDec = 5
    SeparatePositiveLSNegativeLS = 6


class Config_ProhibitOvertravelType(IntEnum):
    """Response to a new target too near to stop for: overshoot and return, brake harder, or step the velocity down."""

    Disabled = 0
    ChangeDeceleration = 1
    ChangeInitialVelocity = 2


class Config_FollowingErrorAlarmType(IntEnum):
    NoAction = 0
    QuickStop = 1


class Config_VelocityFollowingErrorAlarmType(IntEnum):
    NoAction = 0
    QuickStop = 1
    Warning = 2


class Config_EStopLevel1Type(IntEnum):
    Dec = 0
    DecServoOff = 1


class Config_EStopSignalSource(IntEnum):
    Input = 0
    Output = 1
    UserMemory = 2
