// Numbers of the protocol, the codes, and the entries of a parameter file with the vendor's defaults.
// Written by robot_stack/wmx/bridge/generate.py. Do not edit.

#pragma once

#include <cstddef>
#include <cstdint>

namespace tables {

constexpr std::size_t N_REALS = 10, N_FLAGS = 29, MAX_AXES = 128;
constexpr std::int64_t MAGIC = 1398295895, LAYOUT = 4;
constexpr std::size_t LARGEST_FRAME = 262144;
constexpr char SOCKET_FILE[] = "engine.sock", STATUS_FILE[] = "engine.status";

struct Entry {
    const char* path;
    double normal;
    bool whole;
};

inline constexpr Entry GLOBAL_ENTRIES[] = {
    {"FlightRecorderParam/EnableFlightRecorder", 1.0, true},
    {"FlightRecorderParam/FlightRecorderTimeStamp", 0.0, true},
    {"FlightRecorderParam/TriggerFlightRecorderOnAmpAlarm", 1.0, true},
    {"EmergencyStopParam/EnableEStopSignal", 0.0, true},
    {"EmergencyStopParam/EStopSignalSource", 0.0, true},
    {"EmergencyStopParam/EStopSignalLevel", 1.0, true},
    {"EmergencyStopParam/InvertEStopSignalPolarity", 0.0, true},
    {"EmergencyStopParam/EStopSignalByteAddress", 0.0, true},
    {"EmergencyStopParam/EStopSignalBitAddress", 0.0, true},
    {"EmergencyStopParam/EnableEStopStatusSignal", 0.0, true},
    {"EmergencyStopParam/EStopStatusSignalDestination", 0.0, true},
    {"EmergencyStopParam/InvertEStopStatusSignalPolarity", 0.0, true},
    {"EmergencyStopParam/EStopStatusSignalByteAddress", 0.0, true},
    {"EmergencyStopParam/EStopStatusSignalBitAddress", 0.0, true},
    {"EmergencyStopParam/EStopLevel1Type", 0.0, true},
};

inline constexpr Entry AXIS_ENTRIES[] = {
    {"FeedbackParam/InPosWidth", 1000.0, false},
    {"FeedbackParam/InPosWidth2", 1000.0, false},
    {"FeedbackParam/InPosWidth3", 1000.0, false},
    {"FeedbackParam/InPosWidth4", 1000.0, false},
    {"FeedbackParam/InPosWidth5", 1000.0, false},
    {"FeedbackParam/VelMonitorSource", 0.0, true},
    {"FeedbackParam/PosSetWidth", 1000.0, false},
    {"FeedbackParam/DelayedPosSetWidth", 1000.0, false},
    {"FeedbackParam/DelayedPosSetMilliseconds", 0.0, false},
    {"HomeParam/HomeType", 0.0, true},
    {"HomeParam/HomeDir", 0.0, true},
    {"HomeParam/HomingVelSlow", 10000.0, false},
    {"HomeParam/HomingVelSlowAcc", 10000.0, false},
    {"HomeParam/HomingVelSlowDec", 10000.0, false},
    {"HomeParam/HomingVelFast", 10000.0, false},
    {"HomeParam/HomingVelFastAcc", 10000.0, false},
    {"HomeParam/HomingVelFastDec", 10000.0, false},
    {"HomeParam/HomingReverseDistance", 0.0, false},
    {"HomeParam/HomeShiftVel", 10000.0, false},
    {"HomeParam/HomeShiftAcc", 10000.0, false},
    {"HomeParam/HomeShiftDec", 10000.0, false},
    {"HomeParam/HomeShiftDistance", 0.0, false},
    {"HomeParam/InvertHSPolarity", 0.0, true},
    {"HomeParam/MultipleZPulse", 0.0, true},
    {"HomeParam/RoundPosCmdAfterHoming", 0.0, true},
    {"HomeParam/PauseMode", 0.0, true},
    {"HomeParam/MaxHSOnAtStartReverseDistance", 0.0, false},
    {"HomeParam/MaxLSReverseDistance", 0.0, false},
    {"HomeParam/ZPulseDistanceCheck", 0.0, true},
    {"HomeParam/HomePosition", 0.0, false},
    {"HomeParam/GantryHomingUseSlaveHS", 0.0, true},
    {"HomeParam/GantryHomingUseSlaveLS", 0.0, true},
    {"HomeParam/GantryHomingUseSlaveZPulse", 0.0, true},
    {"HomeParam/GantryHomingUseSlaveTouchProbe", 0.0, true},
    {"HomeParam/GantryHomingUseSlaveMechanicalEnd", 0.0, true},
    {"HomeParam/GantryHomingRetainSyncOffset", 0.0, true},
    {"HomeParam/ImmediateStopAtLS", 0.0, true},
    {"HomeParam/MechanicalEndDetectionPosDiff", 0.0, false},
    {"HomeParam/MechanicalEndDetectionTimeMilliseconds", 0.0, false},
    {"HomeParam/MechanicalEndDetectionIgnoreLS", 0.0, true},
    {"HomeParam/MechanicalEndDetectionFirstTorqueLimit", 0.0, false},
    {"HomeParam/MechanicalEndDetectionSecondTorqueLimit", 0.0, false},
    {"HomeParam/OpenLoopHoming", 0.0, true},
    {"HomeParam/ClearHomeDoneOnServoOff", 0.0, true},
    {"HomeParam/ClearHomeDoneOnCommStop", 1.0, true},
    {"HomeParam/KeepMechEndTorqueLimit", 1.0, true},
    {"LimitParam/LSType", 0.0, true},
    {"LimitParam/PositiveLSType", 0.0, true},
    {"LimitParam/NegativeLSType", 0.0, true},
    {"LimitParam/InvertPositiveLSPolarity", 0.0, true},
    {"LimitParam/InvertNegativeLSPolarity", 0.0, true},
    {"LimitParam/LSDec", 10000.0, false},
    {"LimitParam/LSSlowDec", 10000.0, false},
    {"LimitParam/SoftLimitType", 0.0, true},
    {"LimitParam/PositiveSoftLimitType", 0.0, true},
    {"LimitParam/NegativeSoftLimitType", 0.0, true},
    {"LimitParam/SoftLimitPositivePos", 0.0, false},
    {"LimitParam/SoftLimitNegativePos", 0.0, false},
    {"LimitParam/AllLSDuringHoming", 0.0, true},
    {"LimitParam/NearLSType", 0.0, true},
    {"LimitParam/NearPositiveLSType", 0.0, true},
    {"LimitParam/NearNegativeLSType", 0.0, true},
    {"LimitParam/InvertNearPositiveLSPolarity", 0.0, true},
    {"LimitParam/NearPositiveLSByte", 0.0, true},
    {"LimitParam/NearPositiveLSBit", 0.0, true},
    {"LimitParam/InvertNearNegativeLSPolarity", 0.0, true},
    {"LimitParam/NearNegativeLSByte", 0.0, true},
    {"LimitParam/NearNegativeLSBit", 0.0, true},
    {"LimitParam/ExternalLSType", 0.0, true},
    {"LimitParam/ExternalPositiveLSType", 0.0, true},
    {"LimitParam/ExternalNegativeLSType", 0.0, true},
    {"LimitParam/InvertExternalPositiveLSPolarity", 0.0, true},
    {"LimitParam/ExternalPositiveLSByte", 0.0, true},
    {"LimitParam/ExternalPositiveLSBit", 0.0, true},
    {"LimitParam/InvertExternalNegativeLSPolarity", 0.0, true},
    {"LimitParam/ExternalNegativeLSByte", 0.0, true},
    {"LimitParam/ExternalNegativeLSBit", 0.0, true},
    {"LimitParam/LSDirection", 0.0, true},
    {"MotionParam/QuickStopDec", 100000.0, false},
    {"MotionParam/ProhibitOvertravel", 1.0, true},
    {"MotionParam/LinearIntplOverrideType", 2.0, true},
    {"MotionParam/LinearIntplOverrideSmoothPercent", 30.0, true},
    {"MotionParam/CircularIntplOverrideType", 1.0, true},
    {"MotionParam/InterruptedIntplUseQuickStop", 0.0, true},
    {"MotionParam/SingleTurnReduceToHalfTurn", 1.0, true},
    {"MotionParam/EnableGlobalStartingVelocity", 0.0, true},
    {"MotionParam/GlobalStartingVelocity", 0.0, false},
    {"MotionParam/EnableGlobalEndVelocity", 0.0, true},
    {"MotionParam/GlobalEndVelocity", 0.0, false},
    {"MotionParam/EnableGlobalMinVelocity", 0.0, true},
    {"MotionParam/GlobalMinVelocity", 0.0, false},
    {"MotionParam/EnableGlobalMovingAverageProfileTimeMilliseconds", 0.0, true},
    {"MotionParam/GlobalMovingAverageProfileTimeMilliseconds", 0.0, false},
    {"MotionParam/APIWaitUntilMotionStart", 1.0, true},
    {"MotionParam/LinearIntplProfileCalcMode", 0.0, true},
    {"AlarmParam/FollowingErrorType", 0.0, true},
    {"AlarmParam/FollowingErrorStopped", 0.0, false},
    {"AlarmParam/FollowingErrorMoving", 0.0, false},
    {"AlarmParam/VelFollowingErrorType", 0.0, true},
    {"AlarmParam/VelFollowingErrorStopped", 0.0, false},
    {"AlarmParam/VelFollowingErrorStoppedMilliseconds", 0.0, false},
    {"AlarmParam/VelFollowingErrorMoving", 0.0, false},
    {"AlarmParam/VelFollowingErrorMovingMilliseconds", 0.0, false},
    {"AlarmParam/ServoOffDuringAmpAlarm", 1.0, true},
    {"AlarmParam/ServoOnFollowingError", 10000.0, true},
    {"SyncParam/InSyncWidth", 0.0, false},
    {"SyncParam/LimitCompensation", 0.0, false},
    {"SyncParam/SyncGain", 0.0, false},
    {"SyncParam/SyncCompensationMode", 1.0, true},
    {"SyncParam/MasterDesyncType", 0.0, true},
    {"SyncParam/MasterDesyncDec", 10000.0, false},
    {"SyncParam/SlaveDesyncType", 0.0, true},
    {"SyncParam/SlaveDesyncDec", 10000.0, false},
    {"SyncParam/SyncLS", 0.0, true},
    {"SyncParam/MatchPos", 0.0, true},
    {"ClosedLoopParam/pid/proportionalGain", 0.0, false},
    {"ClosedLoopParam/pid/integralGain", 0.0, false},
    {"ClosedLoopParam/pid/derivativeGain", 0.0, false},
    {"ClosedLoopParam/pid/derivativeFilterTimeConstant", 0.0, false},
    {"ClosedLoopParam/pid/limitIntegral", 0.0, false},
    {"ClosedLoopParam/pid/limitOutput", 0.0, false},
    {"ClosedLoopParam/pid/deadband", 0.0, false},
    {"ClosedLoopParam/pid/controlOutputOffset", 0.0, false},
    {"ClosedLoopParam/pid/rampRate", 0.0, false},
    {"ClosedLoopParam/sensor/sensorType", 0.0, true},
    {"ClosedLoopParam/sensor/analogData/byteAddress", 0.0, true},
    {"ClosedLoopParam/sensor/analogData/type", 0.0, true},
    {"ClosedLoopParam/sensor/analogData/minimum", 0.0, false},
    {"ClosedLoopParam/sensor/analogData/maximum", 0.0, false},
    {"ClosedLoopParam/sensor/axisData/axis", 0.0, true},
    {"ClosedLoopParam/sensor/axisData/type", 0.0, true},
    {"ClosedLoopParam/sensor/minimum", 0.0, false},
    {"ClosedLoopParam/sensor/maximum", 0.0, false},
    {"ClosedLoopParam/sensor/offset", 0.0, false},
    {"FlightRecorderParam/CollectAxisFlightRecorderData", 1.0, true},
    {"EmergencyStopParam/EStopDec", 100000.0, false},
    {"AxisParam/AxisCommandMode", 0.0, true},
    {"AxisParam/AxisGearRatioNumerator", 1.0, false},
    {"AxisParam/AxisGearRatioDenominator", 1.0, false},
    {"AxisParam/SingleTurnMode", 0.0, true},
    {"AxisParam/SingleTurnEncoderCount", 65536.0, true},
    {"AxisParam/MaxTrqLimit", 300.0, false},
    {"AxisParam/EnableMaxTrqLimitRamp", 0.0, true},
    {"AxisParam/MaxTrqLimitRampRate", 300.0, false},
    {"AxisParam/PosFErrorInstantMaxTrqLimitThreshold", 0.0, false},
    {"AxisParam/NegativeTrqLimit", 300.0, false},
    {"AxisParam/PositiveTrqLimit", 300.0, false},
    {"AxisParam/AxisUnit", 0.0, false},
    {"AxisParam/VelocityFeedforwardGain", 0.0, false},
    {"AxisParam/AxisPolarity", 1.0, true},
    {"AxisParam/MaxMotorSpeed", 3000.0, false},
    {"AxisParam/AbsoluteEncoderMode", 0.0, true},
    {"AxisParam/AbsoluteEncoderHomeOffset", 0.0, false},
    {"AxisParam/EncoderRangeMode", 0.0, true},
    {"AxisParam/EncoderRangeLow", 0.0, true},
    {"AxisParam/EncoderRangeHigh", 0.0, true},
};

}  // namespace tables

// The port's numbers of the codes.
namespace codes {

constexpr int None = 0;
constexpr int StartProcessFailed = 256;
constexpr int StartProcessLockError = 259;
constexpr int StartProcessWaitTimeout = 261;
constexpr int MemoryAllocFailed = 262;
constexpr int IMLibIsNotRunning = 263;
constexpr int APIChannelError = 269;
constexpr int APIChannelTimeOut = 270;
constexpr int StatusChannelError = 271;
constexpr int CloseDeviceTimeOut = 276;
constexpr int ReachMaxChannelNumber = 278;
constexpr int CloseDeviceFailed = 281;
constexpr int StatusChannelNull = 282;
constexpr int CreateDeviceLockError = 297;
constexpr int CloseDeviceLockError = 298;
constexpr int SetDeviceNameTimeout = 299;
constexpr int DeviceIsNull = 301;
constexpr int NoSupportedFunction = 304;
constexpr int CommandQueueIsFull = 307;
constexpr int IMLibInvalidParam = 318;
constexpr int SystemError = 1280;
constexpr int SystemIsNoRunning = 1281;
constexpr int SystemInitializationNotDone = 1282;
constexpr int EngineNotStartedInSpecifiedTime = 1283;
constexpr int EngineNotStoppedInSpecifiedTime = 1284;
constexpr int CommNotStartedInSpecifiedTime = 1285;
constexpr int CommNotStoppedInSpecifiedTime = 1286;
constexpr int StartCommunicationError = 1288;
constexpr int DeviceIsNotInUse = 1289;
constexpr int CommNotStarted = 1537;
constexpr int CommNotStopped = 1538;
constexpr int NotIdleState = 1546;
constexpr int AxisOutOfRange = 1547;
constexpr int AxisCountOutOfRange = 1548;
constexpr int DuplicateAxis = 1549;
constexpr int IOAddressOutOfRange = 1550;
constexpr int IOSizeOutOfRange = 1551;
constexpr int ChannelOutOfRange = 1552;
constexpr int ArgumentOutOfRange = 1555;
constexpr int ArgumentIsNull = 1556;
constexpr int ParamOutOfRange = 1558;
constexpr int ResourceInUse = 1561;
constexpr int FileOperationFailed = 1562;
constexpr int StartingPreviousCommand = 1563;
constexpr int NoMotion = 1565;
constexpr int ServoOffline = 1566;
constexpr int ServoOff = 1567;
constexpr int AxisAmpAlarm = 1568;
constexpr int AxisSoftLimit = 1569;
constexpr int AxisNearLimit = 1570;
constexpr int AxisExternalLimit = 1571;
constexpr int AxisHardLimit = 1572;
constexpr int ParameterSettingsInvalid = 65536;
constexpr int ServoOnError = 65537;
constexpr int ParameterFileParseError = 65542;
constexpr int CurrentEmergencyStopLevelIsHigher = 65546;
constexpr int NotServoOn = 65556;
constexpr int NotIdleOrPosState = 65557;
constexpr int NotPosState = 65558;
constexpr int NotIdleOrJogState = 65559;
constexpr int NotIdleOrVelocityState = 65560;
constexpr int NotIdleOrIntplState = 65561;
constexpr int NotIdleOrPosOrJogState = 65562;
constexpr int NotPosMode = 65571;
constexpr int NotVelocityMode = 65572;
constexpr int NotTrqMode = 65573;
constexpr int NotPosOrVelocityMode = 65574;
constexpr int NotHomeState = 65576;
constexpr int AxisArgumentOutOfRange = 65578;
constexpr int ProfileArgumentOutOfRange = 65579;
constexpr int PositionArgumentOutOfRange = 65580;
constexpr int VelocityArgumentOutOfRange = 65581;
constexpr int AccArgumentOutOfRange = 65582;
constexpr int DecArgumentOutOfRange = 65583;
constexpr int StartingVelocityArgumentOutOfRange = 65588;
constexpr int EndVelocityArgumentOutOfRange = 65589;
constexpr int RunTimeArgumentOutOfRange = 65591;
constexpr int TimeArgumentOutOfRange = 65592;
constexpr int WaitTimeout = 65616;
constexpr int ProfileTypeNotSupported = 65617;
constexpr int ChannelExecutingCommands = 65622;
constexpr int ChannelNotEnoughSpace = 65624;
constexpr int ChannelBufferMemoryNotAllocated = 65627;
constexpr int ChannelBufferMemoryAlreadyAllocated = 65628;
constexpr int ChannelBufferMemoryFailedToAllocate = 65629;
constexpr int EmergencyStopSignalOn = 65632;
constexpr int CurrentAxisCommandModeNotSupported = 65635;
constexpr int AxisCommandModeOutOfRange = 65659;
constexpr int ZPulseDetectionUnsupported = 65660;
constexpr int TouchProbeDetectionUnsupported = 65661;
constexpr int HomeSwitchDetectionUnsupported = 65662;
constexpr int LimitSwitchDetectionUnsupported = 65663;
constexpr int SplineStartingPositionNotCurrentPosition = 94210;
constexpr int TimeBetweenPointsTooClose = 94222;
constexpr int DimensionOutOfRange = 94224;
constexpr int PointCountBelowMinimum = 94225;
constexpr int FirstPointTimeNotZero = 94245;
constexpr int ScanNetworkFailed = 8193;
constexpr int HotconnectFailed = 8194;
constexpr int SlaveRegReadError = 8208;

}  // namespace codes
