// Enumerations of the stand-in, all but the error codes' zero with other numbers than the port's.
// Written by robot_stack/wmx/bridge/generate.py. Do not edit.

#pragma once

namespace wmx3Api {

struct AxisCommandMode {
    enum T {
        Position = 0, Velocity = 1, Torque = 3, EntryOfAnotherVersion = 2
    };
};
struct DetailOperationState {
    enum T {
        Idle = 0, Pos = 201, Jog = 301, Home = 401, Stop = 701, Stop_QStop = 702, Stop_EStop = 703, Intpl = 801,
        Intpl_Spline = 805, Velocity = 901, EntryOfAnotherVersion = 2
    };
};
struct DeviceType {
    enum T {
        DeviceTypeNormal = 0, DeviceTypeLowPriority = 1, DeviceTypeExitWOCnt = 3, DeviceTypeLowpriorityExitWOCnt = 4,
        EntryOfAnotherVersion = 2
    };
};
struct EStopLevel {
    enum T {
        Final = 0, Level1 = 1, EntryOfAnotherVersion = 2
    };
};
struct EngineState {
    enum T {
        Idle = 0, Running = 1, Communicating = 3, Shutdown = 4, Unknown = 5, EntryOfAnotherVersion = 2
    };
};
struct HomeError {
    enum T {
        NoError = 0, LSTriggered = 1, MaxLSRevDistanceTraveled = 3, MaxHSOnAtStartRevDistanceTraveled = 4,
        ZPulseDistanceCheckError = 5, EntryOfAnotherVersion = 2
    };
};
struct HomeState {
    enum T {
        Idle = 0, ZPulseSearch = 1, ZPulseSearchReverse = 3, ZPulseSearchPauseReverse = 4, HSSearch = 5, HSSearchPause
        = 6, HSAndZPulseSearch = 7, HSAndZPulseSearchPause = 8, HSOffSearch = 9, HSOffSearchPause = 10,
        HSOffAndZPulseSearch = 11, HSOffAndZPulseSearchPause = 12, LSSearch = 13, LSSearchPause = 14, HSClearReverse =
        15, HSClearReversePause = 16, HSFallingEdgeSearchReverse = 17, HSFallingEdgeSearchReversePause = 18,
        LSFallingEdgeSearchReverse = 19, LSFallingEdgeSearchReversePause = 20, TouchProbeSearch = 21,
        TouchProbeSearchPause = 22, SecondHSSearch = 23, SecondHSSearchPause = 24, SecondTouchProbeSearch = 25,
        SecondTouchProbeSearchPause = 26, MechanicalEndDetection = 27, HomeShift = 28, HomeShiftPause = 29, Cancel =
        30, EntryOfAnotherVersion = 2
    };
};
struct OperationState {
    enum T {
        Idle = 0, Pos = 1, Jog = 3, Home = 4, Sync = 5, GantryHome = 6, Stop = 7, Intpl = 8, Velocity = 9,
        ConstLinearVelocity = 10, Trq = 11, DirectControl = 12, PVT = 13, ECAM = 14, EntryOfAnotherVersion = 2
    };
};
struct ProfileType {
    enum T {
        Trapezoidal = 0, SCurve = 1, JerkRatio = 3, Parabolic = 4, Sin = 5, AdvancedS = 6, TrapezoidalMAT = 7,
        JerkLimited = 8, JerkLimitedSCurve = 9, JerkLimitedAdvancedS = 10, TwoVelocityTrapezoidal = 11,
        TwoVelocitySCurve = 12, TwoVelocityJerkRatio = 13, TimeAccTrapezoidal = 14, EntryOfAnotherVersion = 2
    };
};
struct ErrorCode {
    enum {
        None = 0, StartProcessFailed = 257, StartProcessLockError = 260, StartProcessWaitTimeout = 262,
        MemoryAllocFailed = 263, IMLibIsNotRunning = 264, APIChannelError = 270, APIChannelTimeOut = 271,
        StatusChannelError = 272, CloseDeviceTimeOut = 277, ReachMaxChannelNumber = 279, CloseDeviceFailed = 282,
        StatusChannelNull = 283, CreateDeviceLockError = 298, CloseDeviceLockError = 299, SetDeviceNameTimeout = 300,
        DeviceIsNull = 302, NoSupportedFunction = 305, CommandQueueIsFull = 308, IMLibInvalidParam = 319, SystemError
        = 1281, SystemIsNoRunning = 1282, SystemInitializationNotDone = 1283, EngineNotStartedInSpecifiedTime = 1284,
        EngineNotStoppedInSpecifiedTime = 1285, CommNotStartedInSpecifiedTime = 1286, CommNotStoppedInSpecifiedTime =
        1287, StartCommunicationError = 1289, DeviceIsNotInUse = 1290, CommNotStarted = 1538, CommNotStopped = 1539,
        NotIdleState = 1547, AxisOutOfRange = 1548, AxisCountOutOfRange = 1549, DuplicateAxis = 1550,
        IOAddressOutOfRange = 1551, IOSizeOutOfRange = 1552, ChannelOutOfRange = 1553, ArgumentOutOfRange = 1556,
        ArgumentIsNull = 1557, ParamOutOfRange = 1559, ResourceInUse = 1562, FileOperationFailed = 1563,
        StartingPreviousCommand = 1564, NoMotion = 1566, ServoOffline = 1567, ServoOff = 1568, AxisAmpAlarm = 1569,
        AxisSoftLimit = 1570, AxisNearLimit = 1571, AxisExternalLimit = 1572, AxisHardLimit = 1573
    };
};
struct CoreMotionErrorCode : ErrorCode {
    enum {
        ParameterSettingsInvalid = 65537, ServoOnError = 65538, ParameterFileParseError = 65543,
        CurrentEmergencyStopLevelIsHigher = 65547, NotServoOn = 65557, NotIdleOrPosState = 65558, NotPosState = 65559,
        NotIdleOrJogState = 65560, NotIdleOrVelocityState = 65561, NotIdleOrIntplState = 65562, NotIdleOrPosOrJogState
        = 65563, NotPosMode = 65572, NotVelocityMode = 65573, NotTrqMode = 65574, NotPosOrVelocityMode = 65575,
        NotHomeState = 65577, AxisArgumentOutOfRange = 65579, ProfileArgumentOutOfRange = 65580,
        PositionArgumentOutOfRange = 65581, VelocityArgumentOutOfRange = 65582, AccArgumentOutOfRange = 65583,
        DecArgumentOutOfRange = 65584, StartingVelocityArgumentOutOfRange = 65589, EndVelocityArgumentOutOfRange =
        65590, RunTimeArgumentOutOfRange = 65592, TimeArgumentOutOfRange = 65593, WaitTimeout = 65617,
        ProfileTypeNotSupported = 65618, ChannelExecutingCommands = 65623, ChannelNotEnoughSpace = 65625,
        ChannelBufferMemoryNotAllocated = 65628, ChannelBufferMemoryAlreadyAllocated = 65629,
        ChannelBufferMemoryFailedToAllocate = 65630, EmergencyStopSignalOn = 65633, CurrentAxisCommandModeNotSupported
        = 65636, AxisCommandModeOutOfRange = 65660, ZPulseDetectionUnsupported = 65661, TouchProbeDetectionUnsupported
        = 65662, HomeSwitchDetectionUnsupported = 65663, LimitSwitchDetectionUnsupported = 65664
    };
};
struct AdvancedMotionErrorCode : ErrorCode {
    enum {
        SplineStartingPositionNotCurrentPosition = 94211, TimeBetweenPointsTooClose = 94223, DimensionOutOfRange =
        94225, PointCountBelowMinimum = 94226, FirstPointTimeNotZero = 94246
    };
};
struct EcErrorCode : ErrorCode {
    enum {
        ScanNetworkFailed = 8194, HotconnectFailed = 8195, SlaveRegReadError = 8209
    };
};

struct ConfigEnumerations {
    struct EStopLevel1Type {
        enum T {
            Dec = 0, DecServoOff = 1, EntryOfAnotherVersion = 2
        };
    };
    struct EStopSignalSource {
        enum T {
            Input = 0, Output = 1, UserMemory = 3, EntryOfAnotherVersion = 2
        };
    };
    struct FollowingErrorAlarmType {
        enum T {
            NoAction = 0, QuickStop = 1, EntryOfAnotherVersion = 2
        };
    };
    struct HomeDirection {
        enum T {
            Positive = 0, Negative = 1, EntryOfAnotherVersion = 2
        };
    };
    struct HomeType {
        enum T {
            CurrentPos = 0, ZPulse = 1, HS = 3, HSHS = 4, HSZPulse = 5, HSReverseZPulse = 6, HSOff = 7, HSOffZPulse = 8,
            HSOffReverseZPulse = 9, LSReverseZPulse = 10, NearLSReverseZPulse = 11, ExternalLSReverseZPulse = 12,
            TouchProbe = 13, HSTouchProbe = 14, LS = 15, NearLS = 16, ExternalLS = 17, MechanicalEndDetection = 18,
            MechanicalEndDetectionHS = 19, MechanicalEndDetectionLS = 20, MechanicalEndDetectionReverseZPulse = 21,
            EntryOfAnotherVersion = 2
        };
    };
    struct LimitSwitchDirection {
        enum T {
            Normal = 0, Reverse = 1, EntryOfAnotherVersion = 2
        };
    };
    struct LimitSwitchType {
        enum T {
            None = 0, ServoOff = 1, DecServoOff = 3, Dec = 4, SlowDecServoOff = 5, SlowDec = 6,
            SeparatePositiveLSNegativeLS = 7, EntryOfAnotherVersion = 2
        };
    };
    struct ProhibitOvertravelType {
        enum T {
            Disabled = 0, ChangeDeceleration = 1, ChangeInitialVelocity = 3, EntryOfAnotherVersion = 2
        };
    };
    struct VelocityFollowingErrorAlarmType {
        enum T {
            NoAction = 0, QuickStop = 1, Warning = 3, EntryOfAnotherVersion = 2
        };
    };
};

}  // namespace wmx3Api
