"""Error codes of the engine's modules, by the vendor's names.

The numbers are those of engine version 3.5; newer versions insert entries, so code compares by name, never by
number. ``PyNone`` is zero: the vendor's Python module cannot call an attribute ``None``. Each module explains only its
own codes and those of the base; a foreign code is "not defined", as with the vendor.
"""

from __future__ import annotations

import re
from enum import IntEnum
from typing import Final


class ErrorCode(IntEnum):
    """Codes every module may return."""

    PyNone = 0
    StartProcessFailed = 256
    StartProcessLockError = 259
    StartProcessWaitTimeout = 261
    MemoryAllocFailed = 262
    IMLibIsNotRunning = 263
    APIChannelError = 269
    APIChannelTimeOut = 270
    StatusChannelError = 271
    CloseDeviceTimeOut = 276
    ReachMaxChannelNumber = 278
    CloseDeviceFailed = 281
    StatusChannelNull = 282
    CreateDeviceLockError = 297
    CloseDeviceLockError = 298
    SetDeviceNameTimeout = 299
    DeviceIsNull = 301
    NoSupportedFunction = 304
    CommandQueueIsFull = 307
    IMLibInvalidParam = 318
    SystemError = 1280
    SystemIsNoRunning = 1281
    SystemInitializationNotDone = 1282
    EngineNotStartedInSpecifiedTime = 1283
    EngineNotStoppedInSpecifiedTime = 1284
    CommNotStartedInSpecifiedTime = 1285
    CommNotStoppedInSpecifiedTime = 1286
    StartCommunicationError = 1288
    DeviceIsNotInUse = 1289
    CommNotStarted = 1537
    CommNotStopped = 1538
    NotIdleState = 1546
    AxisOutOfRange = 1547
    AxisCountOutOfRange = 1548
    DuplicateAxis = 1549
    IOAddressOutOfRange = 1550
    IOSizeOutOfRange = 1551
    ChannelOutOfRange = 1552
    ArgumentOutOfRange = 1555
    ArgumentIsNull = 1556
    ParamOutOfRange = 1558
    ResourceInUse = 1561
    FileOperationFailed = 1562
    StartingPreviousCommand = 1563
    NoMotion = 1565
    ServoOffline = 1566
    ServoOff = 1567
    AxisAmpAlarm = 1568
    AxisSoftLimit = 1569
    AxisNearLimit = 1570
    AxisExternalLimit = 1571
    AxisHardLimit = 1572


class CoreMotionErrorCode(IntEnum):
    """Codes of CoreMotion."""

    ParameterSettingsInvalid = 65536
    ServoOnError = 65537
    ParameterFileParseError = 65542
    CurrentEmergencyStopLevelIsHigher = 65546
    NotServoOn = 65556
    NotIdleOrPosState = 65557
    NotPosState = 65558
    NotIdleOrJogState = 65559
    NotIdleOrVelocityState = 65560
    NotIdleOrIntplState = 65561
    NotIdleOrPosOrJogState = 65562
    NotPosMode = 65571
    NotVelocityMode = 65572
    NotTrqMode = 65573
    NotPosOrVelocityMode = 65574
    NotHomeState = 65576
    AxisArgumentOutOfRange = 65578
    ProfileArgumentOutOfRange = 65579
    PositionArgumentOutOfRange = 65580
    VelocityArgumentOutOfRange = 65581
    AccArgumentOutOfRange = 65582
    DecArgumentOutOfRange = 65583
    StartingVelocityArgumentOutOfRange = 65588
    EndVelocityArgumentOutOfRange = 65589
    RunTimeArgumentOutOfRange = 65591
    TimeArgumentOutOfRange = 65592
    WaitTimeout = 65616
    ProfileTypeNotSupported = 65617
    ChannelExecutingCommands = 65622
    ChannelNotEnoughSpace = 65624
    ChannelBufferMemoryNotAllocated = 65627
    ChannelBufferMemoryAlreadyAllocated = 65628
    ChannelBufferMemoryFailedToAllocate = 65629
    EmergencyStopSignalOn = 65632
    CurrentAxisCommandModeNotSupported = 65635
    AxisCommandModeOutOfRange = 65659
    ZPulseDetectionUnsupported = 65660
    TouchProbeDetectionUnsupported = 65661
    HomeSwitchDetectionUnsupported = 65662
    LimitSwitchDetectionUnsupported = 65663


class AdvancedMotionErrorCode(IntEnum):
    """Codes of AdvancedMotion. Their numbers follow from the order of the vendor's list only."""

    SplineStartingPositionNotCurrentPosition = 94210
    TimeBetweenPointsTooClose = 94222
    DimensionOutOfRange = 94224
    PointCountBelowMinimum = 94225
    FirstPointTimeNotZero = 94245


class EcErrorCode(IntEnum):
    """Codes of the EtherCAT module."""

    ScanNetworkFailed = 8193
    HotconnectFailed = 8194
    SlaveRegReadError = 8208


_TEXTS: Final[dict[int, str]] = {
    ErrorCode.PyNone: "no error",
    ErrorCode.StartProcessFailed: "the engine could not be started",
    ErrorCode.IMLibIsNotRunning: "no engine is running there",
    ErrorCode.APIChannelError: "the connection to the engine is broken",
    ErrorCode.APIChannelTimeOut: "the engine did not answer in time",
    ErrorCode.StatusChannelError: "the engine's status is stale or unreadable",
    ErrorCode.StatusChannelNull: "the engine publishes no status",
    ErrorCode.ReachMaxChannelNumber: "no free device channel is left",
    ErrorCode.CreateDeviceLockError: "another device is being created at this moment",
    ErrorCode.CloseDeviceLockError: "another device is being closed at this moment",
    ErrorCode.DeviceIsNull: "there is no open device",
    ErrorCode.NoSupportedFunction: "the function is not supported",
    ErrorCode.EngineNotStartedInSpecifiedTime: "the engine did not start in the given time",
    ErrorCode.EngineNotStoppedInSpecifiedTime: "the engine did not stop in the given time",
    ErrorCode.CommNotStartedInSpecifiedTime: "communication did not start in the given time",
    ErrorCode.CommNotStoppedInSpecifiedTime: "communication did not stop in the given time",
    ErrorCode.StartCommunicationError: "communication cannot start now",
    ErrorCode.CommNotStarted: "communication is not started",
    ErrorCode.NotIdleState: "the axis is not idle",
    ErrorCode.AxisOutOfRange: "the axis number is out of range",
    ErrorCode.AxisCountOutOfRange: "the number of axes is out of range",
    ErrorCode.DuplicateAxis: "an axis is named twice",
    ErrorCode.IOAddressOutOfRange: "the I/O address is out of range",
    ErrorCode.IOSizeOutOfRange: "the I/O size is out of range",
    ErrorCode.ArgumentOutOfRange: "an argument is out of range",
    ErrorCode.ServoOffline: "the servo is offline",
    ErrorCode.ServoOff: "the servo is off",
    ErrorCode.AxisAmpAlarm: "the axis has an alarm",
    ErrorCode.AxisSoftLimit: "the axis is at a software limit",
    CoreMotionErrorCode.ParameterSettingsInvalid: "a parameter setting is invalid",
    CoreMotionErrorCode.ServoOnError: "the servo cannot be switched on while a following error alarm is set",
    CoreMotionErrorCode.CurrentEmergencyStopLevelIsHigher: "an emergency stop of a higher level is active",
    CoreMotionErrorCode.NotServoOn: "the servo is not on",
    CoreMotionErrorCode.NotIdleOrPosState: "the axis is neither idle nor in a position motion",
    CoreMotionErrorCode.NotIdleOrVelocityState: "the axis is neither idle nor in a velocity motion",
    CoreMotionErrorCode.NotPosMode: "the axis is not in position mode",
    CoreMotionErrorCode.NotVelocityMode: "the axis is not in velocity mode",
    CoreMotionErrorCode.PositionArgumentOutOfRange: "the position is not finite or out of range",
    CoreMotionErrorCode.VelocityArgumentOutOfRange: "the velocity is not finite or out of range",
    CoreMotionErrorCode.AccArgumentOutOfRange: "the acceleration is not finite or out of range",
    CoreMotionErrorCode.DecArgumentOutOfRange: "the deceleration is not finite or out of range",
    CoreMotionErrorCode.WaitTimeout: "the wait ended before the motion",
    CoreMotionErrorCode.ProfileTypeNotSupported: "the profile type is not supported",
    CoreMotionErrorCode.EmergencyStopSignalOn: "an emergency stop is active",
    CoreMotionErrorCode.NotIdleOrIntplState: "the axis is neither idle nor in an interpolation",
    CoreMotionErrorCode.TimeArgumentOutOfRange: "a time is not finite or out of range",
    CoreMotionErrorCode.ChannelExecutingCommands: "the channel is executing a motion",
    CoreMotionErrorCode.ChannelNotEnoughSpace: "there are more points than the channel's buffer holds",
    CoreMotionErrorCode.ChannelBufferMemoryNotAllocated: "the channel has no buffer",
    CoreMotionErrorCode.ChannelBufferMemoryAlreadyAllocated: "the channel has a buffer already",
    AdvancedMotionErrorCode.TimeBetweenPointsTooClose: "two points are closer than 0.001 ms",
    AdvancedMotionErrorCode.DimensionOutOfRange: "the number of axes of the spline is out of range",
    AdvancedMotionErrorCode.PointCountBelowMinimum: "the spline has too few points that differ",
    EcErrorCode.ScanNetworkFailed: "the network scan failed",
    EcErrorCode.HotconnectFailed: "no slave can be connected without communication",
}

Codes = type[IntEnum]


def error_text(code: int, *modules: Codes) -> str:
    """The meaning of ``code`` for an API module with the given enumerations; "not defined" for a foreign code."""
    for module in modules:
        try:
            name = module(code).name
        except ValueError:
            continue
        return _TEXTS.get(code) or re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()
    return "error code not defined"


def error_name(code: int) -> str:
    """The vendor's name of ``code`` in any module; the number as text for an unknown code."""
    modules: tuple[Codes, ...] = (ErrorCode, CoreMotionErrorCode, EcErrorCode, AdvancedMotionErrorCode)
    for module in modules:
        try:
            return module(code).name
        except ValueError:
            continue
    return str(int(code))
