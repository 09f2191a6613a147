// Numbers by name, records field by field, and rows of the status.
// Written by robot_stack/wmx/bridge/generate.py. Do not edit.

#pragma once

namespace vendor {

constexpr int STRANGER = 1073741824, ABSENT = -1073741824;

struct Pair {
    int ours, theirs;
};

// theirs is ABSENT for a name that this version of the vendor's headers lacks.
#define NAMED(kind, name, number) \
    []<class K>(K*) constexpr -> Pair { \
        if constexpr (requires { K::name; }) return {number, static_cast<int>(K::name)}; \
        else return {number, ABSENT}; \
    }(static_cast<kind*>(nullptr))

template <class T>
inline constexpr Pair NAMES[] = {{0, 0}};

template <>
inline constexpr Pair NAMES<AxisCommandMode::T>[] = {
    NAMED(AxisCommandMode, Position, 0),
    NAMED(AxisCommandMode, Velocity, 1),
    NAMED(AxisCommandMode, Torque, 2),
};

template <>
inline constexpr Pair NAMES<Config::EStopLevel1Type::T>[] = {
    NAMED(Config::EStopLevel1Type, Dec, 0),
    NAMED(Config::EStopLevel1Type, DecServoOff, 1),
};

template <>
inline constexpr Pair NAMES<Config::EStopSignalSource::T>[] = {
    NAMED(Config::EStopSignalSource, Input, 0),
    NAMED(Config::EStopSignalSource, Output, 1),
    NAMED(Config::EStopSignalSource, UserMemory, 2),
};

template <>
inline constexpr Pair NAMES<Config::FollowingErrorAlarmType::T>[] = {
    NAMED(Config::FollowingErrorAlarmType, NoAction, 0),
    NAMED(Config::FollowingErrorAlarmType, QuickStop, 1),
};

template <>
inline constexpr Pair NAMES<Config::HomeDirection::T>[] = {
    NAMED(Config::HomeDirection, Positive, 0),
    NAMED(Config::HomeDirection, Negative, 1),
};

template <>
inline constexpr Pair NAMES<Config::HomeType::T>[] = {
    NAMED(Config::HomeType, CurrentPos, 0),
    NAMED(Config::HomeType, ZPulse, 1),
    NAMED(Config::HomeType, HS, 2),
    NAMED(Config::HomeType, HSHS, 3),
    NAMED(Config::HomeType, HSZPulse, 4),
    NAMED(Config::HomeType, HSReverseZPulse, 5),
    NAMED(Config::HomeType, HSOff, 6),
    NAMED(Config::HomeType, HSOffZPulse, 7),
    NAMED(Config::HomeType, HSOffReverseZPulse, 8),
    NAMED(Config::HomeType, LSReverseZPulse, 9),
    NAMED(Config::HomeType, NearLSReverseZPulse, 10),
    NAMED(Config::HomeType, ExternalLSReverseZPulse, 11),
    NAMED(Config::HomeType, TouchProbe, 12),
    NAMED(Config::HomeType, HSTouchProbe, 13),
    NAMED(Config::HomeType, LS, 14),
    NAMED(Config::HomeType, NearLS, 15),
    NAMED(Config::HomeType, ExternalLS, 16),
    NAMED(Config::HomeType, MechanicalEndDetection, 17),
    NAMED(Config::HomeType, MechanicalEndDetectionHS, 18),
    NAMED(Config::HomeType, MechanicalEndDetectionLS, 19),
    NAMED(Config::HomeType, MechanicalEndDetectionReverseZPulse, 20),
};

template <>
inline constexpr Pair NAMES<Config::LimitSwitchDirection::T>[] = {
    NAMED(Config::LimitSwitchDirection, Normal, 0),
    NAMED(Config::LimitSwitchDirection, Reverse, 1),
};

template <>
inline constexpr Pair NAMES<Config::LimitSwitchType::T>[] = {
    NAMED(Config::LimitSwitchType, None, 0),
    NAMED(Config::LimitSwitchType, ServoOff, 1),
    NAMED(Config::LimitSwitchType, DecServoOff, 2),
    NAMED(Config::LimitSwitchType, Dec, 3),
    NAMED(Config::LimitSwitchType, SlowDecServoOff, 4),
    NAMED(Config::LimitSwitchType, SlowDec, 5),
    NAMED(Config::LimitSwitchType, SeparatePositiveLSNegativeLS, 6),
};

template <>
inline constexpr Pair NAMES<Config::ProhibitOvertravelType::T>[] = {
    NAMED(Config::ProhibitOvertravelType, Disabled, 0),
    NAMED(Config::ProhibitOvertravelType, ChangeDeceleration, 1),
    NAMED(Config::ProhibitOvertravelType, ChangeInitialVelocity, 2),
};

template <>
inline constexpr Pair NAMES<Config::VelocityFollowingErrorAlarmType::T>[] = {
    NAMED(Config::VelocityFollowingErrorAlarmType, NoAction, 0),
    NAMED(Config::VelocityFollowingErrorAlarmType, QuickStop, 1),
    NAMED(Config::VelocityFollowingErrorAlarmType, Warning, 2),
};

template <>
inline constexpr Pair NAMES<DetailOperationState::T>[] = {
    NAMED(DetailOperationState, Idle, 0),
    NAMED(DetailOperationState, Pos, 200),
    NAMED(DetailOperationState, Jog, 300),
    NAMED(DetailOperationState, Home, 400),
    NAMED(DetailOperationState, Stop, 700),
    NAMED(DetailOperationState, Stop_QStop, 701),
    NAMED(DetailOperationState, Stop_EStop, 702),
    NAMED(DetailOperationState, Intpl, 800),
    NAMED(DetailOperationState, Intpl_Spline, 804),
    NAMED(DetailOperationState, Velocity, 900),
};

template <>
inline constexpr Pair NAMES<DeviceType::T>[] = {
    NAMED(DeviceType, DeviceTypeNormal, 0),
    NAMED(DeviceType, DeviceTypeLowPriority, 1),
    NAMED(DeviceType, DeviceTypeExitWOCnt, 2),
    NAMED(DeviceType, DeviceTypeLowpriorityExitWOCnt, 3),
};

template <>
inline constexpr Pair NAMES<EStopLevel::T>[] = {
    NAMED(EStopLevel, Final, 0),
    NAMED(EStopLevel, Level1, 1),
};

template <>
inline constexpr Pair NAMES<EngineState::T>[] = {
    NAMED(EngineState, Idle, 0),
    NAMED(EngineState, Running, 1),
    NAMED(EngineState, Communicating, 2),
    NAMED(EngineState, Shutdown, 3),
    NAMED(EngineState, Unknown, 4),
};

template <>
inline constexpr Pair NAMES<HomeError::T>[] = {
    NAMED(HomeError, NoError, 0),
    NAMED(HomeError, LSTriggered, 1),
    NAMED(HomeError, MaxLSRevDistanceTraveled, 2),
    NAMED(HomeError, MaxHSOnAtStartRevDistanceTraveled, 3),
    NAMED(HomeError, ZPulseDistanceCheckError, 4),
};

template <>
inline constexpr Pair NAMES<HomeState::T>[] = {
    NAMED(HomeState, Idle, 0),
    NAMED(HomeState, ZPulseSearch, 1),
    NAMED(HomeState, ZPulseSearchReverse, 2),
    NAMED(HomeState, ZPulseSearchPauseReverse, 3),
    NAMED(HomeState, HSSearch, 4),
    NAMED(HomeState, HSSearchPause, 5),
    NAMED(HomeState, HSAndZPulseSearch, 6),
    NAMED(HomeState, HSAndZPulseSearchPause, 7),
    NAMED(HomeState, HSOffSearch, 8),
    NAMED(HomeState, HSOffSearchPause, 9),
    NAMED(HomeState, HSOffAndZPulseSearch, 10),
    NAMED(HomeState, HSOffAndZPulseSearchPause, 11),
    NAMED(HomeState, LSSearch, 12),
    NAMED(HomeState, LSSearchPause, 13),
    NAMED(HomeState, HSClearReverse, 14),
    NAMED(HomeState, HSClearReversePause, 15),
    NAMED(HomeState, HSFallingEdgeSearchReverse, 16),
    NAMED(HomeState, HSFallingEdgeSearchReversePause, 17),
    NAMED(HomeState, LSFallingEdgeSearchReverse, 18),
    NAMED(HomeState, LSFallingEdgeSearchReversePause, 19),
    NAMED(HomeState, TouchProbeSearch, 20),
    NAMED(HomeState, TouchProbeSearchPause, 21),
    NAMED(HomeState, SecondHSSearch, 22),
    NAMED(HomeState, SecondHSSearchPause, 23),
    NAMED(HomeState, SecondTouchProbeSearch, 24),
    NAMED(HomeState, SecondTouchProbeSearchPause, 25),
    NAMED(HomeState, MechanicalEndDetection, 26),
    NAMED(HomeState, HomeShift, 27),
    NAMED(HomeState, HomeShiftPause, 28),
    NAMED(HomeState, Cancel, 29),
};

template <>
inline constexpr Pair NAMES<OperationState::T>[] = {
    NAMED(OperationState, Idle, 0),
    NAMED(OperationState, Pos, 1),
    NAMED(OperationState, Jog, 2),
    NAMED(OperationState, Home, 3),
    NAMED(OperationState, Sync, 4),
    NAMED(OperationState, GantryHome, 5),
    NAMED(OperationState, Stop, 6),
    NAMED(OperationState, Intpl, 7),
    NAMED(OperationState, Velocity, 8),
    NAMED(OperationState, ConstLinearVelocity, 9),
    NAMED(OperationState, Trq, 10),
    NAMED(OperationState, DirectControl, 11),
    NAMED(OperationState, PVT, 12),
    NAMED(OperationState, ECAM, 13),
};

template <>
inline constexpr Pair NAMES<ProfileType::T>[] = {
    NAMED(ProfileType, Trapezoidal, 0),
    NAMED(ProfileType, SCurve, 1),
    NAMED(ProfileType, JerkRatio, 2),
    NAMED(ProfileType, Parabolic, 3),
    NAMED(ProfileType, Sin, 4),
    NAMED(ProfileType, AdvancedS, 5),
    NAMED(ProfileType, TrapezoidalMAT, 6),
    NAMED(ProfileType, JerkLimited, 7),
    NAMED(ProfileType, JerkLimitedSCurve, 8),
    NAMED(ProfileType, JerkLimitedAdvancedS, 9),
    NAMED(ProfileType, TwoVelocityTrapezoidal, 10),
    NAMED(ProfileType, TwoVelocitySCurve, 11),
    NAMED(ProfileType, TwoVelocityJerkRatio, 12),
    NAMED(ProfileType, TimeAccTrapezoidal, 13),
};

struct Errors {};
template <>
inline constexpr Pair NAMES<Errors>[] = {
    NAMED(ErrorCode, None, 0),
    NAMED(ErrorCode, StartProcessFailed, 256),
    NAMED(ErrorCode, StartProcessLockError, 259),
    NAMED(ErrorCode, StartProcessWaitTimeout, 261),
    NAMED(ErrorCode, MemoryAllocFailed, 262),
    NAMED(ErrorCode, IMLibIsNotRunning, 263),
    NAMED(ErrorCode, APIChannelError, 269),
    NAMED(ErrorCode, APIChannelTimeOut, 270),
    NAMED(ErrorCode, StatusChannelError, 271),
    NAMED(ErrorCode, CloseDeviceTimeOut, 276),
    NAMED(ErrorCode, ReachMaxChannelNumber, 278),
    NAMED(ErrorCode, CloseDeviceFailed, 281),
    NAMED(ErrorCode, StatusChannelNull, 282),
    NAMED(ErrorCode, CreateDeviceLockError, 297),
    NAMED(ErrorCode, CloseDeviceLockError, 298),
    NAMED(ErrorCode, SetDeviceNameTimeout, 299),
    NAMED(ErrorCode, DeviceIsNull, 301),
    NAMED(ErrorCode, NoSupportedFunction, 304),
    NAMED(ErrorCode, CommandQueueIsFull, 307),
    NAMED(ErrorCode, IMLibInvalidParam, 318),
    NAMED(ErrorCode, SystemError, 1280),
    NAMED(ErrorCode, SystemIsNoRunning, 1281),
    NAMED(ErrorCode, SystemInitializationNotDone, 1282),
    NAMED(ErrorCode, EngineNotStartedInSpecifiedTime, 1283),
    NAMED(ErrorCode, EngineNotStoppedInSpecifiedTime, 1284),
    NAMED(ErrorCode, CommNotStartedInSpecifiedTime, 1285),
    NAMED(ErrorCode, CommNotStoppedInSpecifiedTime, 1286),
    NAMED(ErrorCode, StartCommunicationError, 1288),
    NAMED(ErrorCode, DeviceIsNotInUse, 1289),
    NAMED(ErrorCode, CommNotStarted, 1537),
    NAMED(ErrorCode, CommNotStopped, 1538),
    NAMED(ErrorCode, NotIdleState, 1546),
    NAMED(ErrorCode, AxisOutOfRange, 1547),
    NAMED(ErrorCode, AxisCountOutOfRange, 1548),
    NAMED(ErrorCode, DuplicateAxis, 1549),
    NAMED(ErrorCode, IOAddressOutOfRange, 1550),
    NAMED(ErrorCode, IOSizeOutOfRange, 1551),
    NAMED(ErrorCode, ChannelOutOfRange, 1552),
    NAMED(ErrorCode, ArgumentOutOfRange, 1555),
    NAMED(ErrorCode, ArgumentIsNull, 1556),
    NAMED(ErrorCode, ParamOutOfRange, 1558),
    NAMED(ErrorCode, ResourceInUse, 1561),
    NAMED(ErrorCode, FileOperationFailed, 1562),
    NAMED(ErrorCode, StartingPreviousCommand, 1563),
    NAMED(ErrorCode, NoMotion, 1565),
    NAMED(ErrorCode, ServoOffline, 1566),
    NAMED(ErrorCode, ServoOff, 1567),
    NAMED(ErrorCode, AxisAmpAlarm, 1568),
    NAMED(ErrorCode, AxisSoftLimit, 1569),
    NAMED(ErrorCode, AxisNearLimit, 1570),
    NAMED(ErrorCode, AxisExternalLimit, 1571),
    NAMED(ErrorCode, AxisHardLimit, 1572),
    NAMED(CoreMotionErrorCode, ParameterSettingsInvalid, 65536),
    NAMED(CoreMotionErrorCode, ServoOnError, 65537),
    NAMED(CoreMotionErrorCode, ParameterFileParseError, 65542),
    NAMED(CoreMotionErrorCode, CurrentEmergencyStopLevelIsHigher, 65546),
    NAMED(CoreMotionErrorCode, NotServoOn, 65556),
    NAMED(CoreMotionErrorCode, NotIdleOrPosState, 65557),
    NAMED(CoreMotionErrorCode, NotPosState, 65558),
    NAMED(CoreMotionErrorCode, NotIdleOrJogState, 65559),
    NAMED(CoreMotionErrorCode, NotIdleOrVelocityState, 65560),
    NAMED(CoreMotionErrorCode, NotIdleOrIntplState, 65561),
    NAMED(CoreMotionErrorCode, NotIdleOrPosOrJogState, 65562),
    NAMED(CoreMotionErrorCode, NotPosMode, 65571),
    NAMED(CoreMotionErrorCode, NotVelocityMode, 65572),
    NAMED(CoreMotionErrorCode, NotTrqMode, 65573),
    NAMED(CoreMotionErrorCode, NotPosOrVelocityMode, 65574),
    NAMED(CoreMotionErrorCode, NotHomeState, 65576),
    NAMED(CoreMotionErrorCode, AxisArgumentOutOfRange, 65578),
    NAMED(CoreMotionErrorCode, ProfileArgumentOutOfRange, 65579),
    NAMED(CoreMotionErrorCode, PositionArgumentOutOfRange, 65580),
    NAMED(CoreMotionErrorCode, VelocityArgumentOutOfRange, 65581),
    NAMED(CoreMotionErrorCode, AccArgumentOutOfRange, 65582),
    NAMED(CoreMotionErrorCode, DecArgumentOutOfRange, 65583),
    NAMED(CoreMotionErrorCode, StartingVelocityArgumentOutOfRange, 65588),
    NAMED(CoreMotionErrorCode, EndVelocityArgumentOutOfRange, 65589),
    NAMED(CoreMotionErrorCode, RunTimeArgumentOutOfRange, 65591),
    NAMED(CoreMotionErrorCode, TimeArgumentOutOfRange, 65592),
    NAMED(CoreMotionErrorCode, WaitTimeout, 65616),
    NAMED(CoreMotionErrorCode, ProfileTypeNotSupported, 65617),
    NAMED(CoreMotionErrorCode, ChannelExecutingCommands, 65622),
    NAMED(CoreMotionErrorCode, ChannelNotEnoughSpace, 65624),
    NAMED(CoreMotionErrorCode, ChannelBufferMemoryNotAllocated, 65627),
    NAMED(CoreMotionErrorCode, ChannelBufferMemoryAlreadyAllocated, 65628),
    NAMED(CoreMotionErrorCode, ChannelBufferMemoryFailedToAllocate, 65629),
    NAMED(CoreMotionErrorCode, EmergencyStopSignalOn, 65632),
    NAMED(CoreMotionErrorCode, CurrentAxisCommandModeNotSupported, 65635),
    NAMED(CoreMotionErrorCode, AxisCommandModeOutOfRange, 65659),
    NAMED(CoreMotionErrorCode, ZPulseDetectionUnsupported, 65660),
    NAMED(CoreMotionErrorCode, TouchProbeDetectionUnsupported, 65661),
    NAMED(CoreMotionErrorCode, HomeSwitchDetectionUnsupported, 65662),
    NAMED(CoreMotionErrorCode, LimitSwitchDetectionUnsupported, 65663),
    NAMED(AdvancedMotionErrorCode, SplineStartingPositionNotCurrentPosition, 94210),
    NAMED(AdvancedMotionErrorCode, TimeBetweenPointsTooClose, 94222),
    NAMED(AdvancedMotionErrorCode, DimensionOutOfRange, 94224),
    NAMED(AdvancedMotionErrorCode, PointCountBelowMinimum, 94225),
    NAMED(AdvancedMotionErrorCode, FirstPointTimeNotZero, 94245),
    NAMED(EcErrorCode, ScanNetworkFailed, 8193),
    NAMED(EcErrorCode, HotconnectFailed, 8194),
    NAMED(EcErrorCode, SlaveRegReadError, 8208),
};

#undef NAMED

template <class V>
void visit(Profile& r, V&& v) {
    v(r.type);
    v(r.velocity);
    v(r.acc);
    v(r.dec);
    v(r.accTimeMilliseconds);
    v(r.decTimeMilliseconds);
    v(r.startingVelocity);
    v(r.endVelocity);
}

template <class V>
void visit(Motion::PosCommand& r, V&& v) {
    v(r.axis);
    v(r.target);
    v(r.profile);
}

template <class V>
void visit(Velocity::VelCommand& r, V&& v) {
    v(r.axis);
    v(r.profile);
}

template <class V>
void visit(Velocity::TimedVelCommand& r, V&& v) {
    v(r.axis);
    v(r.runTimeMilliseconds);
    v(r.profile);
}

template <class V>
void visit(Config::FeedbackParam& r, V&& v) {
    v(r.inPosWidth);
    v(r.posSetWidth);
    v(r.delayedPosSetWidth);
    v(r.delayedPosSetMilliseconds);
}

template <class V>
void visit(Config::HomeParam& r, V&& v) {
    v(r.homeType);
    v(r.homeDirection);
    v(r.homingVelocitySlow);
    v(r.homingVelocitySlowAcc);
    v(r.homingVelocitySlowDec);
    v(r.homingVelocityFast);
    v(r.homingVelocityFastAcc);
    v(r.homingVelocityFastDec);
    v(r.homingReverseDistance);
    v(r.homeShiftVelocity);
    v(r.homeShiftAcc);
    v(r.homeShiftDec);
    v(r.homeShiftDistance);
    v(r.invertHSPolarity);
    v(r.maxHSOnAtStartReverseDistance);
    v(r.maxLSReverseDistance);
    v(r.homePosition);
    v(r.clearHomeDoneOnServoOff);
    v(r.clearHomeDoneOnCommStop);
}

template <class V>
void visit(Config::LimitParam& r, V&& v) {
    v(r.lsType);
    v(r.positiveLSType);
    v(r.negativeLSType);
    v(r.invertPositiveLSPolarity);
    v(r.invertNegativeLSPolarity);
    v(r.softLimitType);
    v(r.positiveSoftLimitType);
    v(r.negativeSoftLimitType);
    v(r.softLimitPositivePos);
    v(r.softLimitNegativePos);
    v(r.lsDec);
    v(r.lsSlowDec);
    v(r.lsDirection);
}

template <class V>
void visit(Config::MotionParam& r, V&& v) {
    v(r.quickStopDec);
    v(r.prohibitOvertravel);
    v(r.interruptedIntplUseQuickStop);
}

template <class V>
void visit(Config::AlarmParam& r, V&& v) {
    v(r.followingErrorStopped);
    v(r.followingErrorMoving);
    v(r.followingErrorType);
    v(r.velocityFollowingErrorStopped);
    v(r.velocityFollowingErrorStoppedMilliseconds);
    v(r.velocityFollowingErrorMoving);
    v(r.velocityFollowingErrorMovingMilliseconds);
    v(r.velocityFollowingErrorType);
    v(r.servoOffDuringAmpAlarm);
}

template <class V>
void visit(Config::EmergencyStopParam& r, V&& v) {
    v(r.eStopDec);
    v(r.enableEStopSignal);
    v(r.eStopSignalSource);
    v(r.eStopSignalLevel);
    v(r.invertEStopSignalPolarity);
    v(r.eStopSignalByteAddress);
    v(r.eStopSignalBitAddress);
    v(r.eStopLevel1Type);
}

template <class V>
void visit(Config::AxisParam& r, V&& v) {
    v(r.axisCommandMode);
    v(r.gearRatioNumerator);
    v(r.gearRatioDenominator);
    v(r.axisPolarity);
    v(r.absoluteEncoderMode);
    v(r.absoluteEncoderHomeOffset);
}

// Fields that a version lacks are left out; those that the robot needs must exist.
template <class Axis, class V>
void visit_status(Axis& a, V&& v) {
    v.flag(0, a.servoOn, false);
    v.flag(1, a.servoOn, true);
    v.flag(2, a.servoOffline, false);
    v.flag(3, a.ampAlarm, false);
    if constexpr (requires { a.ampAlarmCode; }) v.flag(4, a.ampAlarmCode, false);
    if constexpr (requires { a.followingErrorAlarm; }) v.flag(5, a.followingErrorAlarm, false);
    v.flag(6, a.opState, false);
    if constexpr (requires { a.detailOpState; }) v.flag(7, a.detailOpState, false);
    v.flag(8, a.axisCommandMode, false);
    if constexpr (requires { a.commandReady; }) v.flag(9, a.commandReady, false);
    if constexpr (requires { a.motionComplete; }) v.flag(10, a.motionComplete, false);
    if constexpr (requires { a.inPos; }) v.flag(11, a.inPos, false);
    if constexpr (requires { a.cmdDistributionEnd; }) v.flag(12, a.cmdDistributionEnd, false);
    if constexpr (requires { a.posSet; }) v.flag(13, a.posSet, false);
    if constexpr (requires { a.delayedPosSet; }) v.flag(14, a.delayedPosSet, false);
    if constexpr (requires { a.positiveSoftLimit; }) v.flag(15, a.positiveSoftLimit, false);
    if constexpr (requires { a.negativeSoftLimit; }) v.flag(16, a.negativeSoftLimit, false);
    if constexpr (requires { a.homeState; }) v.flag(17, a.homeState, false);
    if constexpr (requires { a.homeDone; }) v.flag(18, a.homeDone, false);
    if constexpr (requires { a.accFlag; }) v.flag(19, a.accFlag, false);
    if constexpr (requires { a.decFlag; }) v.flag(20, a.decFlag, false);
    if constexpr (requires { a.encoderCommand; }) v.flag(21, a.encoderCommand, false);
    if constexpr (requires { a.encoderFeedback; }) v.flag(22, a.encoderFeedback, false);
    if constexpr (requires { a.positiveLS; }) v.flag(25, a.positiveLS, false);
    if constexpr (requires { a.negativeLS; }) v.flag(26, a.negativeLS, false);
    if constexpr (requires { a.homeSwitch; }) v.flag(27, a.homeSwitch, false);
    if constexpr (requires { a.homeError; }) v.flag(28, a.homeError, false);
    v.real(0, a.posCmd, false);
    v.real(1, a.actualPos, false);
    if constexpr (requires { a.velocityCmd; }) v.real(2, a.velocityCmd, false);
    if constexpr (requires { a.actualVelocity; }) v.real(3, a.actualVelocity, false);
    if constexpr (requires { a.actualTorque; }) v.real(4, a.actualTorque, false);
    if constexpr (requires { a.profileTargetPos; }) v.real(5, a.profileTargetPos, false);
    if constexpr (requires { a.profileRemainingMilliseconds; }) v.real(6, a.profileRemainingMilliseconds, false);
    if constexpr (requires { a.cmdAcc; }) v.real(7, a.cmdAcc, false);
    if constexpr (requires { a.homeOffset; }) v.real(8, a.homeOffset, false);
}

constexpr int SERVO_OFFLINE = 2, COMMAND_MODE = 8;
constexpr int OP_STATE = 6, POS_CMD = 0;
constexpr int ACTUAL_POS = 1, FOLLOWING_ERROR = 9;

}  // namespace vendor
