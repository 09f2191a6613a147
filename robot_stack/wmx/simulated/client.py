"""The port on the simulated engine, as its clients use it: device, status, emergency stop, I/O.

The path of CreateDevice and StartEngine: the vendor's installation roots and "" mean the stack's own runtime folder,
any other path is taken as the runtime folder of an engine. The engine's process is started by whoever owns it (the
simulation, or ``python -m robot_stack.wmx.simulated``), never by a client: a device can only be created where one
runs.
"""

from __future__ import annotations

import operator
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, overload

from robot_stack.core.runtime import runtime_dir
from robot_stack.wmx.api.enums import EngineState
from robot_stack.wmx.api.errors import CoreMotionErrorCode, ErrorCode, error_text
from robot_stack.wmx.api.status import (
    CoreMotionAxisStatus,
    CoreMotionStatus,
    DeviceInfo,
    DevicesInfo,
    EngineStatus,
)
from robot_stack.wmx.api.values import INFINITE
from robot_stack.wmx.axes import Flag, Real, StatusSnapshot, empty_snapshot
from robot_stack.wmx.simulated.channel import Channel, Reply, StatusView
from robot_stack.wmx.simulated.client_axes import AxisControl, Home, Motion, Velocity
from robot_stack.wmx.simulated.client_config import Config

INSTALLATION_ROOTS: Final = ("", "/opt/lmx", "/opt/wmx3")
_POLL_S: Final = 0.001

_FLAG_FIELDS: Final = {
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
_CODE_FIELDS: Final = {
    "ampAlarmCode": Flag.AMP_ALARM_CODE,
    "encoderCommand": Flag.ENCODER_COMMAND,
    "encoderFeedback": Flag.ENCODER_FEEDBACK,
    "opState": Flag.OP_STATE,
    "detailOpState": Flag.DETAIL_OP_STATE,
    "axisCommandMode": Flag.COMMAND_MODE,
    "homeState": Flag.HOME_STATE,
    "homeError": Flag.HOME_ERROR,
}
_REAL_FIELDS: Final = {
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


@dataclass(frozen=True, slots=True)
class ClientLimits:
    """How patient a client is: seconds for a call, and for the age of a status."""

    call_timeout_s: float
    status_stale_s: float


def engine_folder(path: str) -> Path:
    """The runtime folder that a device path means."""
    return runtime_dir() if path.rstrip("/") in INSTALLATION_ROOTS else Path(path)


class WMX3Api:
    """A device on the simulated engine."""

    def __init__(self, limits: ClientLimits) -> None:
        self._limits = limits
        self._channel: Channel | None = None
        self._status: StatusView | None = None
        self._device_id = 0
        self._epoch = -1

    # -- used by the other API objects of this device -----------------------------------------------------------------

    def call(self, method: str, *arguments: Any) -> Reply:
        """(code, values) of a request by this device."""
        if self._channel is None or not self._device_id:
            return ErrorCode.DeviceIsNull, []
        code, values = self._channel.call(method, *arguments)
        if code == ErrorCode.DeviceIsNull:
            self._forget()
        return code, values

    def command(self, method: str, *arguments: Any) -> int:
        """The code of a request that answers nothing else."""
        return self.call(method, *arguments)[0]

    def snapshot(self) -> tuple[int, StatusSnapshot]:
        """The latest status without a round trip; DeviceIsNull once the engine was stopped by anyone."""
        if self._status is None or not self._device_id:
            return ErrorCode.DeviceIsNull, empty_snapshot()
        code, snapshot = self._status.read()
        if not code and snapshot.epoch != self._epoch:
            self._forget()
            return ErrorCode.DeviceIsNull, empty_snapshot()
        return code, snapshot

    def wait_for(self, decided: Callable[[StatusSnapshot], int | None], milliseconds: float, timeout_code: int) -> int:
        """Polls the status until ``decided`` gives a code, the status fails, or the time is over."""
        deadline = None if milliseconds >= INFINITE else time.monotonic() + 1e-3 * milliseconds
        while True:
            code, snapshot = self.snapshot()
            if code:
                return code
            result = decided(snapshot)
            if result is not None:
                return result
            if deadline is not None and time.monotonic() >= deadline:
                return timeout_code
            time.sleep(_POLL_S)

    # -- the vendor's surface -----------------------------------------------------------------------------------------

    def CreateDevice(self, path: str, deviceType: int = 0, waitTimeMilliseconds: int = 0) -> int:
        """Waits up to the given time for an engine that is just starting or stopping; not for the creation lock."""
        if self.IsDeviceValid():
            return ErrorCode.ResourceInUse
        self._forget()
        deadline = time.monotonic() + 1e-3 * min(waitTimeMilliseconds, INFINITE)
        while True:
            code = self._create(engine_folder(path), operator.index(deviceType))
            starting = code in (ErrorCode.IMLibIsNotRunning, ErrorCode.EngineNotStartedInSpecifiedTime)
            if not starting or time.monotonic() >= deadline:
                return code
            time.sleep(10 * _POLL_S)

    def _create(self, folder: Path, device_type: int) -> int:
        try:
            channel = Channel(folder, self._limits.call_timeout_s)
        except OSError:
            return ErrorCode.IMLibIsNotRunning
        code, values = channel.call("CreateDevice", device_type)
        if code:
            channel.close()
            return code
        self._channel = channel
        self._device_id, self._epoch = values
        self._status = StatusView(folder, self._limits.status_stale_s)
        return ErrorCode.PyNone

    def CloseDevice(self) -> int:
        code = self.command("CloseDevice")
        if code != ErrorCode.CloseDeviceLockError:
            self._forget()
        return code

    def IsDeviceValid(self) -> bool:
        return self.snapshot()[0] == ErrorCode.PyNone and self._channel is not None and self._channel.alive

    def StartEngine(self, path: str, waitTimeMilliseconds: int = 0) -> int:
        try:
            channel = Channel(engine_folder(path), self._limits.call_timeout_s)
        except OSError:
            return ErrorCode.IMLibIsNotRunning
        code, _ = channel.call("StartEngine")
        channel.close()
        return code

    def StopEngine(self, waitTimeMilliseconds: int = 0) -> int:
        status = self._status
        code = self.command("StopEngine")
        self._forget()
        if code or status is None or not waitTimeMilliseconds:
            return code
        deadline = time.monotonic() + 1e-3 * waitTimeMilliseconds
        while True:
            code, snapshot = status.read()
            if code or snapshot.engine_state is not EngineState.Shutdown:
                return code
            if time.monotonic() >= deadline:
                return ErrorCode.EngineNotStoppedInSpecifiedTime
            time.sleep(_POLL_S)

    def RestartEngine(self, path: str, waitTimeMilliseconds: int = 0) -> int:
        code = self.StopEngine(waitTimeMilliseconds)
        return code or self.StartEngine(path, waitTimeMilliseconds)

    def StartCommunication(self, waitTimeMilliseconds: int = 0) -> int:
        code = self.command("StartCommunication")
        if code or not waitTimeMilliseconds:
            return code
        return self.wait_for(
            lambda status: ErrorCode.PyNone if status.communicating else None,
            waitTimeMilliseconds,
            ErrorCode.CommNotStartedInSpecifiedTime,
        )

    def StopCommunication(self, waitTimeMilliseconds: int = 0) -> int:
        return self.command("StopCommunication")

    def GetEngineStatus(self) -> tuple[int, EngineStatus]:
        code, snapshot = self.snapshot()
        if code:
            return code, EngineStatus()
        return code, EngineStatus(snapshot.engine_state, snapshot.engine_error, 1)

    def SetDeviceName(self, name: str) -> int:
        return self.command("SetDeviceName", str(name))

    def GetDeviceName(self) -> tuple[int, str]:
        code, values = self.call("GetDeviceName")
        return code, "" if code else values[0]

    def GetDeviceID(self) -> tuple[int, int]:
        self.snapshot()  # notices that the engine was stopped
        return (ErrorCode.PyNone if self._device_id else ErrorCode.DeviceIsNull), self._device_id

    def GetAllDevices(self) -> tuple[int, DevicesInfo]:
        code, values = self.call("GetAllDevices")
        devices = [] if code else [DeviceInfo(*item) for item in values[0]]
        return code, DevicesInfo(len(devices), devices)

    def SetWatchdog(self, milliseconds: int) -> int:
        return self.command("SetWatchdog", operator.index(milliseconds))

    def GetWatchdog(self) -> tuple[int, int, int]:
        code, values = self.call("GetWatchdog")
        return (code, 0, 0) if code else (code, values[0], values[1])

    def ResetWatchdogTimer(self) -> int:
        return self.command("ResetWatchdogTimer")

    def AutoQuitWithoutActiveDev(self, quit: bool) -> int:
        return self.command("AutoQuitWithoutActiveDev", bool(quit))

    @staticmethod
    def ErrorToString(code: int) -> str:
        return error_text(code, ErrorCode)

    def _forget(self) -> None:
        if self._channel is not None:
            self._channel.close()
        self._channel = None
        self._status = None
        self._device_id = 0


class CoreMotion:
    """Motion control of the simulated engine."""

    def __init__(self, api: WMX3Api) -> None:
        self._api = api
        self.axisControl = AxisControl(api)
        self.motion = Motion(api)
        self.velocity = Velocity(api)
        self.home = Home(api)
        self.config = Config(api)

    def GetStatus(self) -> tuple[int, CoreMotionStatus]:
        code, snapshot = self._api.snapshot()
        return code, CoreMotionStatus() if code else core_motion_status(snapshot)

    def ExecEStop(self, level: int) -> int:
        return self._api.command("ExecEStop", operator.index(level))

    def ReleaseEStop(self) -> int:
        return self._api.command("ReleaseEStop")

    @staticmethod
    def ErrorToString(code: int) -> str:
        return error_text(code, CoreMotionErrorCode, ErrorCode)


class Io:
    """Digital I/O of the simulated engine; reading is without a round trip."""

    def __init__(self, api: WMX3Api) -> None:
        self._api = api

    def SetOutBit(self, byte: int, bit: int, value: int) -> int:
        return self._api.command("SetOutBit", operator.index(byte), operator.index(bit), operator.index(value))

    def SetOutByte(self, byte: int, value: int) -> int:
        return self._api.command("SetOutBytes", operator.index(byte), [operator.index(value)])

    def SetOutBytes(self, byte: int, size: int, data: Sequence[int]) -> int:
        if size != len(data):
            return ErrorCode.IOSizeOutOfRange
        return self._api.command("SetOutBytes", operator.index(byte), [operator.index(value) for value in data])

    def GetOutBit(self, byte: int, bit: int) -> tuple[int, int]:
        return _bit(self.GetOutByte(byte), bit)

    def GetInBit(self, byte: int, bit: int) -> tuple[int, int]:
        return _bit(self.GetInByte(byte), bit)

    def GetOutByte(self, byte: int) -> tuple[int, int]:
        return _first(self.GetOutBytes(byte, 1))

    def GetInByte(self, byte: int) -> tuple[int, int]:
        return _first(self.GetInBytes(byte, 1))

    def GetOutBytes(self, byte: int, size: int) -> tuple[int, list[int]]:
        code, snapshot = self._api.snapshot()
        return (code, []) if code else _slice(snapshot.outputs.tolist(), byte, size)

    def GetInBytes(self, byte: int, size: int) -> tuple[int, list[int]]:
        code, snapshot = self._api.snapshot()
        if not code and not snapshot.communicating:
            code = ErrorCode.CommNotStarted
        return (code, []) if code else _slice(snapshot.inputs.tolist(), byte, size)

    @staticmethod
    def ErrorToString(code: int) -> str:
        return error_text(code, ErrorCode)


def core_motion_status(snapshot: StatusSnapshot) -> CoreMotionStatus:
    """The vendor's status record of a snapshot; the records of the axes are made when they are looked at."""
    return CoreMotionStatus(
        invalidLicenseError=snapshot.invalid_license,
        engineState=snapshot.engine_state,
        numOfInterrupts=1,
        cycleTimeMilliseconds=[1e3 * snapshot.cycle_time_s, 0.0],
        cycleCounter=[snapshot.cycle_counter, 0],
        emergencyStop=snapshot.emergency_stop,
        emergencyStopLevel=snapshot.emergency_stop_level,
        axesStatus=_AxisRecords(snapshot),
    )


class _AxisRecords(Sequence[CoreMotionAxisStatus]):
    def __init__(self, snapshot: StatusSnapshot) -> None:
        self._snapshot = snapshot

    def __len__(self) -> int:
        return self._snapshot.n_axes

    @overload
    def __getitem__(self, index: int) -> CoreMotionAxisStatus: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[CoreMotionAxisStatus]: ...
    def __getitem__(self, index: int | slice) -> CoreMotionAxisStatus | Sequence[CoreMotionAxisStatus]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        reals, flags = self._snapshot.reals[:, index].tolist(), self._snapshot.flags[:, index].tolist()
        record = CoreMotionAxisStatus()
        for name, real in _REAL_FIELDS.items():
            setattr(record, name, reals[real])
        for name, flag in _FLAG_FIELDS.items():
            setattr(record, name, bool(flags[flag]))
        for name, flag in _CODE_FIELDS.items():
            setattr(record, name, flags[flag])
        return record


def _slice(image: list[int], byte: int, size: int) -> tuple[int, list[int]]:
    if not 0 <= byte < len(image):
        return ErrorCode.IOAddressOutOfRange, []
    if not 0 < size <= len(image) - byte:
        return ErrorCode.IOSizeOutOfRange, []
    return ErrorCode.PyNone, image[byte : byte + size]


def _first(answer: tuple[int, list[int]]) -> tuple[int, int]:
    code, values = answer
    return (code, 0) if code else (code, values[0])


def _bit(answer: tuple[int, int], bit: int) -> tuple[int, int]:
    code, value = answer
    if not code and not 0 <= bit < 8:
        code = ErrorCode.IOAddressOutOfRange
    return (code, 0) if code else (code, value >> bit & 1)
