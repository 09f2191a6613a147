// Stand-in, see WMX3Api.h.
#pragma once

#include "WMX3Api.h"

namespace wmx3Api {

struct AxisSelection {
    int axisCount = 0;
    int axis[constants::maxAxes] = {};
};

struct Profile {
    ProfileType::T type = ProfileType::Trapezoidal;
    double velocity = 0, acc = 0, dec = 0, jerkAcc = 0, jerkDec = 0, jerkAccRatio = 0, jerkDecRatio = 0, accTimeMilliseconds = 0,
           decTimeMilliseconds = 0, startingVelocity = 0, endVelocity = 0, secondVelocity = 0;
};

struct CoreMotionAxisStatus {
    bool servoOn = false, servoOffline = true, ampAlarm = false;
    int ampAlarmCode = 0, masterAxis = 0;
    double posCmd = 0, actualPos = 0;
    int encoderCommand = 0, encoderFeedback = 0;
    double velocityCmd = 0, actualVelocity = 0, actualTorque = 0, actualFollowingError = 0;
    OperationState::T opState = OperationState::Idle;
    DetailOperationState::T detailOpState = DetailOperationState::Idle;
    AxisCommandMode::T axisCommandMode = AxisCommandMode::Position;
    double profileRemainingMilliseconds = 0, profileTargetPos = 0;
    bool followingErrorAlarm = false, commandReady = false, motionPaused = false, motionComplete = false;
    double cmdAcc = 0;
    bool accFlag = false, decFlag = false, inPos = false, inPos2 = false, cmdDistributionEnd = false, posSet = false, delayedPosSet = false,
         positiveLS = false, negativeLS = false, nearPositiveLS = false, positiveSoftLimit = false, negativeSoftLimit = false;
    HomeState::T homeState = HomeState::Idle;
    HomeError::T homeError = HomeError::NoError;
    double homeOffset = 0;
    bool homeSwitch = false, homeDone = false, homePaused = false;
};

struct CoreMotionStatus {
    bool invalidLicenseError = false;
    EngineState::T engineState = EngineState::Unknown;
    int numOfInterrupts = 0;
    double cycleTimeMilliseconds[constants::maxInterrupts] = {};
    long long cycleCounter[constants::maxInterrupts] = {};
    bool emergencyStop = false;
    EStopLevel::T emergencyStopLevel = EStopLevel::Level1;
    CoreMotionAxisStatus axesStatus[constants::maxAxes];
};

class CoreMotion;

class Part {
public:
    CoreMotion* cmApi;
    explicit Part(CoreMotion* f) : cmApi(f) {}
};

class AxisControl : public Part {
public:
    using Part::Part;
    WMX3APIFUNC SetServoOn(int axis, int newStatus);
    WMX3APIFUNC SetServoOn(AxisSelection* pAxisSelection, int newStatus);
    WMX3APIFUNC ClearAmpAlarm(int axis);
    WMX3APIFUNC ClearAmpAlarm(AxisSelection* pAxisSelection);
    WMX3APIFUNC ClearAxisAlarm(int axis);
    WMX3APIFUNC ClearAxisAlarm(AxisSelection* pAxisSelection);
    WMX3APIFUNC SetAxisCommandMode(int axis, AxisCommandMode::T mode);
};

class Motion : public Part {
public:
    using Part::Part;
    struct PosCommand {
        int axis = 0;
        double target = 0;
        Profile profile;
    };
    WMX3APIFUNC StartPos(PosCommand* pPosCommand);
    WMX3APIFUNC StartPos(unsigned int numCommands, PosCommand* pPosCommand);
    WMX3APIFUNC StartMov(PosCommand* pPosCommand);
    WMX3APIFUNC StartMov(unsigned int numCommands, PosCommand* pPosCommand);
    WMX3APIFUNC Stop(int axis);
    WMX3APIFUNC Stop(AxisSelection* pAxisSelection);
    WMX3APIFUNC ExecQuickStop(int axis);
    WMX3APIFUNC ExecQuickStop(AxisSelection* pAxisSelection);
};

class Velocity : public Part {
public:
    using Part::Part;
    struct VelCommand {
        int axis = 0;
        Profile profile;
    };
    struct TimedVelCommand {
        int axis = 0;
        double runTimeMilliseconds = 0;
        Profile profile;
    };
    WMX3APIFUNC StartVel(VelCommand* pVelCommand);
    WMX3APIFUNC StartVel(TimedVelCommand* pTimedVelCommand);
    WMX3APIFUNC StartVel(unsigned int numCommands, VelCommand* pVelCommand);
    WMX3APIFUNC StartVel(unsigned int numCommands, TimedVelCommand* pTimedVelCommand);
    WMX3APIFUNC Stop(int axis);
    WMX3APIFUNC Stop(AxisSelection* pAxisSelection);
    WMX3APIFUNC ExecQuickStop(int axis);
    WMX3APIFUNC ExecQuickStop(AxisSelection* pAxisSelection);
};

class Home : public Part {
public:
    using Part::Part;
    WMX3APIFUNC StartHome(int axis);
    WMX3APIFUNC StartHome(AxisSelection* pAxisSelection);
    WMX3APIFUNC Cancel(int axis);
    WMX3APIFUNC SetCommandPos(int axis, double position);
};

class Config : public Part, public ConfigEnumerations {
public:
    using Part::Part;
    struct FeedbackParam {
        double inPosWidth = 0, inPosWidth2 = 0, posSetWidth = 0, delayedPosSetWidth = 0, delayedPosSetMilliseconds = 0;
    };
    struct HomeParam {
        HomeType::T homeType{};
        HomeDirection::T homeDirection{};
        double homingVelocitySlow = 0, homingVelocitySlowAcc = 0, homingVelocitySlowDec = 0, homingVelocityFast = 0, homingVelocityFastAcc = 0,
               homingVelocityFastDec = 0, homingReverseDistance = 0, homeShiftVelocity = 0, homeShiftAcc = 0, homeShiftDec = 0,
               homeShiftDistance = 0;
        bool invertHSPolarity = false;
        unsigned int multipleZPulse = 0;
        double maxHSOnAtStartReverseDistance = 0, maxLSReverseDistance = 0, homePosition = 0;
        bool openLoopHoming = false, clearHomeDoneOnServoOff = false, clearHomeDoneOnCommStop = false;
    };
    struct LimitParam {
        LimitSwitchType::T lsType{}, positiveLSType{}, negativeLSType{};
        bool invertPositiveLSPolarity = false, invertNegativeLSPolarity = false;
        LimitSwitchType::T nearLSType{}, softLimitType{}, positiveSoftLimitType{}, negativeSoftLimitType{};
        double softLimitPositivePos = 0, softLimitNegativePos = 0, lsDec = 0, lsSlowDec = 0;
        LimitSwitchDirection::T lsDirection{};
    };
    struct MotionParam {
        double quickStopDec = 0;
        ProhibitOvertravelType::T prohibitOvertravel{};
        unsigned int linearIntplOverrideSmoothPercent = 0;
        bool interruptedIntplUseQuickStop = false;
    };
    struct AlarmParam {
        double followingErrorStopped = 0, followingErrorMoving = 0;
        FollowingErrorAlarmType::T followingErrorType{};
        double velocityFollowingErrorStopped = 0, velocityFollowingErrorStoppedMilliseconds = 0, velocityFollowingErrorMoving = 0,
               velocityFollowingErrorMovingMilliseconds = 0;
        VelocityFollowingErrorAlarmType::T velocityFollowingErrorType{};
        bool servoOffDuringAmpAlarm = false;
        int servoOnFollowingError = 0;
    };
    struct EmergencyStopParam {
        double eStopDec[constants::maxAxes] = {};
        bool enableEStopSignal = false;
        EStopSignalSource::T eStopSignalSource{};
        EStopLevel::T eStopSignalLevel{};
        bool invertEStopSignalPolarity = false;
        unsigned int eStopSignalByteAddress = 0;
        unsigned char eStopSignalBitAddress = 0;
        bool enableEStopStatusSignal = false;
        EStopLevel1Type::T eStopLevel1Type{};
    };
    struct AxisParam {
        AxisCommandMode::T axisCommandMode[constants::maxAxes] = {};
        double gearRatioNumerator[constants::maxAxes] = {}, gearRatioDenominator[constants::maxAxes] = {};
        char axisPolarity[constants::maxAxes] = {};
        bool absoluteEncoderMode[constants::maxAxes] = {};
        double absoluteEncoderHomeOffset[constants::maxAxes] = {};
    };
    struct SystemParam;

    WMX3APIFUNC GetAxisParam(AxisParam* pParam);
    WMX3APIFUNC SetGearRatio(int axis, double numerator, double denominator);
    WMX3APIFUNC GetGearRatio(int axis, double* pNumerator, double* pDenominator);
    WMX3APIFUNC SetAxisPolarity(int axis, char polarity);
    WMX3APIFUNC GetAxisPolarity(int axis, char* pPolarity);
    WMX3APIFUNC GetFeedbackParam(int axis, FeedbackParam* pParam);
    WMX3APIFUNC GetHomeParam(int axis, HomeParam* pParam);
    WMX3APIFUNC GetLimitParam(int axis, LimitParam* pParam);
    WMX3APIFUNC GetMotionParam(int axis, MotionParam* pParam);
    WMX3APIFUNC GetAlarmParam(int axis, AlarmParam* pParam);
    WMX3APIFUNC GetEmergencyStopParam(EmergencyStopParam* pParam);
    WMX3APIFUNC SetFeedbackParam(int axis, FeedbackParam* pParam, FeedbackParam* pParamError = nullptr);
    WMX3APIFUNC SetHomeParam(int axis, HomeParam* pParam, HomeParam* pParamError = nullptr);
    WMX3APIFUNC SetLimitParam(int axis, LimitParam* pParam, LimitParam* pParamError = nullptr);
    WMX3APIFUNC SetMotionParam(int axis, MotionParam* pParam, MotionParam* pParamError = nullptr);
    WMX3APIFUNC SetAlarmParam(int axis, AlarmParam* pParam, AlarmParam* pParamError = nullptr);
    WMX3APIFUNC SetEmergencyStopParam(EmergencyStopParam* pParam, EmergencyStopParam* pParamError = nullptr);
    WMX3APIFUNC GetAndExportAll(char* pPath);
    WMX3APIFUNC ImportAndSetAll(char* pPath, SystemParam* pParamError = nullptr, AxisParam* pAxisParamError = nullptr);
};

class CoreMotion {
public:
    WMX3Api* wmx3Api;
    AxisControl* axisControl;
    Motion* motion;
    Velocity* velocity;
    Home* home;
    Config* config;

    explicit CoreMotion(WMX3Api* f);
    ~CoreMotion();
    CoreMotion(const CoreMotion&) = delete;
    CoreMotion& operator=(const CoreMotion&) = delete;

    static WMX3APIFUNC ErrorToString(int errCode, char* pString, unsigned int size);
    WMX3APIFUNC GetStatus(CoreMotionStatus* pStatus);
    WMX3APIFUNC ExecEStop(EStopLevel::T level);
    WMX3APIFUNC ReleaseEStop();
};

}  // namespace wmx3Api
