"""Status records of the engine, by the vendor's names. Units as in the commands; torque in percent of rated torque."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from robot_stack.wmx.api.enums import (
    AxisCommandMode,
    DetailOperationState,
    DeviceType,
    EcHotconnectState,
    EcStateMachine,
    EngineState,
    EStopLevel,
    HomeError,
    HomeState,
    OperationState,
)


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

    def GetAxesStatus(self, axis: int) -> CoreMotionAxisStatus:
        """The record of ``axis``; an offline one beyond the configured axes."""
        return self.axesStatus[axis] if 0 <= axis < len(self.axesStatus) else CoreMotionAxisStatus()

    def GetCycleTimeMilliseconds(self, interrupt: int) -> float:
        return self.cycleTimeMilliseconds[interrupt]

    def GetCycleCounter(self, interrupt: int) -> int:
        return self.cycleCounter[interrupt]


@dataclass(slots=True)
class EngineStatus:
    """``error`` is the code of what last took the engine out of communication by itself, 0 for none."""

    state: int = EngineState.Unknown
    error: int = 0
    numOfInterrupts: int = 0


@dataclass(slots=True)
class DeviceInfo:
    id: int = 0
    type: int = DeviceType.DeviceTypeNormal
    watchdog: int = 0
    watchdogCount: int = 0
    name: str = ""


@dataclass(slots=True)
class DevicesInfo:
    count: int = 0
    devices: list[DeviceInfo] = field(default_factory=list)

    def GetDevices(self, index: int) -> DeviceInfo:
        return self.devices[index]


@dataclass(slots=True)
class EcSlaveInfo:
    """One slave. ``position`` counts along the wire, ``address`` is its station address."""

    id: int = 0
    position: int = 0
    address: int = 0
    vendorId: int = 0
    productCode: int = 0
    revisionNo: int = 0
    serialNo: int = 0
    alias: int = 0
    numOfAxes: int = 0
    state: int = EcStateMachine.PyNone
    alStatusCode: int = 0
    offline: int = 0
    inaccessible: int = 0
    newSlave: int = 0
    reverseSlave: int = 0
    inputAddr: int = 0
    inputSize: int = 0
    outputAddr: int = 0
    outputSize: int = 0


@dataclass(slots=True)
class EcMasterStatisticsInfo:
    """``commPeriod`` in ns; ``packetLoss`` counts cycles without an answer since communication started.

    ``packetTimeout`` counts how often the bus was given up, ``overCycle`` cycles that came too late. Sizes in bytes.
    """

    commPeriod: int = 0
    cycleCounter: int = 0
    txDelay: int = 0
    minTxDelay: int = 0
    maxTxDelay: int = 0
    packetLoss: int = 0
    packetTimeout: int = 0
    totalAxesNum: int = 0
    totalRxPdoSize: int = 0
    totalTxPdoSize: int = 0
    totalInputSize: int = 0
    totalOutputSize: int = 0
    overCycle: int = 0
    ringNum: int = 0
    hcState: int = EcHotconnectState.Idle


@dataclass(slots=True)
class EcMasterInfo:
    id: int = 0
    state: int = EcStateMachine.PyNone
    mode: int = 0
    numOfSlaves: int = 0
    slaves: list[EcSlaveInfo] = field(default_factory=list)
    statisticsInfo: EcMasterStatisticsInfo = field(default_factory=EcMasterStatisticsInfo)
