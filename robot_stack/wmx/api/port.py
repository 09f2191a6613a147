"""The engine port: the vendor library's surface as protocols.

Commands return a code; getters return ``(code, value[, value])``, with zero values on failure; setters of parameter
blocks return ``(code, block)`` where the block is the one given. A code of 0 (``ErrorCode.PyNone``) is success. A
rejected call raises nothing. Overloads of the C++ library carry suffixes, as in the vendor's Python module:
``_AxisSel`` takes an AxisSelection. Calls that start motion take one command, or
a count and a list of commands, which is all-or-nothing.

An object belongs to one thread at a time. ``surface`` lists all calls and their arguments as data.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from robot_stack.wmx.api.parameters import (
    Config_AlarmParam,
    Config_AxisParam,
    Config_EmergencyStopParam,
    Config_FeedbackParam,
    Config_HomeParam,
    Config_LimitParam,
    Config_MotionParam,
)
from robot_stack.wmx.api.status import DevicesInfo, EngineStatus
from robot_stack.wmx.api.values import (
    AdvMotion_PointTimeSplineCommand,
    AdvMotion_SplinePoint,
    AxisSelection,
    Motion_PosCommand,
    Velocity_TimedVelCommand,
    Velocity_VelCommand,
)


class WMX3Api(Protocol):
    """A device: one client's handle on the engine."""

    def CreateDevice(self, path: str, deviceType: int = 0, waitTimeMilliseconds: int = 0) -> int:
        """Opens a device; the engine leaves Idle with its first one. May block for seconds (WMX3Api::CreateDevice).

        CreateDeviceLockError while another is created, StartProcessLockError while another process starts the engine:
        retry. SystemInitializationNotDone if the engine is not ready within a given time.
        """
        ...

    def CloseDevice(self) -> int:
        """Closes the device; axes that it commanded continue. Closing the last device ends the engine, even in motion.

        With CloseDeviceLockError it stays open: try again.
        """
        ...

    def IsDeviceValid(self) -> bool: ...
    def StopEngine(self, waitTimeMilliseconds: int = 0) -> int:
        """Ends the engine for all clients; all devices become invalid, parameters and outputs are reset."""
        ...

    def StartCommunication(self, waitTimeMilliseconds: int = 0) -> int:
        """Starts the cyclic bus; with a time, waits that long for it. 0 does not wait."""
        ...

    def StopCommunication(self, waitTimeMilliseconds: int = 0) -> int: ...
    def GetEngineStatus(self) -> tuple[int, EngineStatus]: ...
    def SetDeviceName(self, name: str) -> int: ...
    def GetDeviceName(self) -> tuple[int, str]: ...
    def GetDeviceID(self) -> tuple[int, int]: ...
    def GetAllDevices(self) -> tuple[int, DevicesInfo]: ...

    @staticmethod
    def ErrorToString(code: int) -> str: ...


class AxisControl(Protocol):
    def SetServoOn(self, axis: int, newStatus: int) -> int:
        """A request: the drive reports on or off some cycles later in the status."""
        ...

    def SetServoOn_AxisSel(self, axisSelection: AxisSelection, newStatus: int) -> int: ...
    def ClearAmpAlarm(self, axis: int) -> int:
        """A request: the drive's alarm clears some cycles later, if its cause is gone."""
        ...

    def ClearAmpAlarm_AxisSel(self, axisSelection: AxisSelection) -> int: ...
    def ClearAxisAlarm(self, axis: int) -> int:
        """Clears the engine's own alarm (following error)."""
        ...

    def ClearAxisAlarm_AxisSel(self, axisSelection: AxisSelection) -> int: ...
    def SetAxisCommandMode(self, axis: int, mode: int) -> int: ...
    def GetAxisCommandMode(self, axis: int) -> tuple[int, int]: ...


PosCommands = Motion_PosCommand | int
VelCommands = Velocity_VelCommand | int
TimedVelCommands = Velocity_TimedVelCommand | int


class Motion(Protocol):
    """Motions of axes in position mode."""

    def StartPos(self, command: PosCommands, commands: Sequence[Motion_PosCommand] | None = None) -> int:
        """Absolute target. Over a running position motion it takes over at the current velocity."""
        ...

    def StartMov(self, command: PosCommands, commands: Sequence[Motion_PosCommand] | None = None) -> int:
        """Relative to the commanded position; over a running position motion, relative to THAT motion's target."""
        ...

    def Stop(self, axis: int) -> int:
        """Decelerates by the running command's profile. No error on an idle axis."""
        ...

    def Stop_AxisSel(self, axisSelection: AxisSelection) -> int:
        """Stops the axes that can be, and answers an error if any cannot: an error does not mean that none stops."""
        ...

    def ExecQuickStop(self, axis: int) -> int:
        """Decelerates at QuickStopDec; overrides a stop, and no stop overrides it."""
        ...

    def ExecQuickStop_AxisSel(self, axisSelection: AxisSelection) -> int: ...


class Velocity(Protocol):
    """Motions of axes in velocity mode."""

    def StartVel(self, command: VelCommands, commands: Sequence[Velocity_VelCommand] | None = None) -> int:
        """Runs at a signed velocity without an end. acc where speed grows, dec where it falls; 0: within one cycle."""
        ...

    def StartVel_TimedVel(
        self, command: TimedVelCommands, commands: Sequence[Velocity_TimedVelCommand] | None = None
    ) -> int:
        """Like StartVel, and decelerates by itself after running at the velocity for the time. Profiles by times only
        (TimeAcc..); the times to reach the velocity and to stop are additional to the run time.
        """
        ...

    def Stop(self, axis: int) -> int: ...
    def Stop_AxisSel(self, axisSelection: AxisSelection) -> int: ...
    def ExecQuickStop(self, axis: int) -> int: ...
    def ExecQuickStop_AxisSel(self, axisSelection: AxisSelection) -> int: ...


class Home(Protocol):
    def StartHome(self, axis: int) -> int: ...
    def Cancel(self, axis: int) -> int: ...
    def SetCommandPos(self, axis: int, position: float) -> int:
        """Renames the present commanded position; nothing moves."""
        ...


class Config(Protocol):
    def SetGearRatio(self, axis: int, numerator: float, denominator: float) -> int:
        """Encoder counts = user units * numerator / denominator. Moves the zero: home again."""
        ...

    def GetGearRatio(self, axis: int) -> tuple[int, float, float]: ...
    def SetAxisPolarity(self, axis: int, polarity: int) -> int: ...
    def GetAxisPolarity(self, axis: int) -> tuple[int, int]: ...
    def GetFeedbackParam(self, axis: int) -> tuple[int, Config_FeedbackParam]: ...
    def SetFeedbackParam(self, axis: int, param: Config_FeedbackParam) -> tuple[int, Config_FeedbackParam]: ...
    def GetHomeParam(self, axis: int) -> tuple[int, Config_HomeParam]: ...
    def SetHomeParam(self, axis: int, param: Config_HomeParam) -> tuple[int, Config_HomeParam]: ...
    def GetLimitParam(self, axis: int) -> tuple[int, Config_LimitParam]: ...
    def SetLimitParam(self, axis: int, param: Config_LimitParam) -> tuple[int, Config_LimitParam]: ...
    def GetMotionParam(self, axis: int) -> tuple[int, Config_MotionParam]: ...
    def SetMotionParam(self, axis: int, param: Config_MotionParam) -> tuple[int, Config_MotionParam]: ...
    def GetAlarmParam(self, axis: int) -> tuple[int, Config_AlarmParam]: ...
    def SetAlarmParam(self, axis: int, param: Config_AlarmParam) -> tuple[int, Config_AlarmParam]: ...
    def GetEmergencyStopParam(self) -> tuple[int, Config_EmergencyStopParam]: ...
    def SetEmergencyStopParam(self, param: Config_EmergencyStopParam) -> tuple[int, Config_EmergencyStopParam]: ...
    def GetAxisParam(self) -> tuple[int, Config_AxisParam]: ...
    def ImportAndSetAll(self, filePath: str) -> int:
        """Reads the vendor's parameter XML and sets all of it, or nothing.

        FileOperationFailed for a file that cannot be read, ParameterFileParseError for one that is no such XML,
        ParameterSettingsInvalid for a value that is refused.
        """
        ...

    def GetAndExportAll(self, filePath: str) -> int:
        """Writes all parameters as the vendor's XML, which ImportAndSetAll reads back unchanged."""
        ...


class CoreMotion(Protocol):
    """Motion control on a device. Members are the vendor's."""

    @property
    def axisControl(self) -> AxisControl: ...
    @property
    def motion(self) -> Motion: ...
    @property
    def velocity(self) -> Velocity: ...
    @property
    def home(self) -> Home: ...
    @property
    def config(self) -> Config: ...

    def ExecEStop(self, level: int) -> int:
        """Stops everything. Accepted in every state; latched until ReleaseEStop."""
        ...

    def ReleaseEStop(self) -> int: ...
    @staticmethod
    def ErrorToString(code: int) -> str: ...


class AdvMotion(Protocol):
    """Splines. A channel has a buffer, which is created before use; one spline at a time runs on it."""

    def CreateSplineBuffer(self, channel: int, points: int) -> int:
        """ChannelBufferMemoryAlreadyAllocated if the channel has one."""
        ...

    def FreeSplineBuffer(self, channel: int) -> int:
        """ChannelBufferMemoryNotAllocated if the channel has none."""
        ...

    def GetSplineBufferPoints(self, channel: int) -> tuple[int, int]: ...
    def StartCSplinePos_PointTime(
        self,
        channel: int,
        command: AdvMotion_PointTimeSplineCommand,
        numPoints: int,
        points: Sequence[AdvMotion_SplinePoint],
        pointTimeMilliseconds: Sequence[float],
    ) -> int:
        """A cubic spline through the points at their times, from rest at the commanded position to rest.

        The axes run in OperationState.Intpl. Times ascend; a first point at time 0 is the present position and is
        passed over. No velocity or acceleration limit applies. Stop of any of its axes stops all of them along the
        path.
        """
        ...


class AdvancedMotion(Protocol):
    """Motions of several axes together."""

    @property
    def advMotion(self) -> AdvMotion: ...
    @staticmethod
    def ErrorToString(code: int) -> str: ...


class Io(Protocol):
    """Digital outputs by byte and bit; inputs are in the status."""

    def SetOutBit(self, byte: int, bit: int, value: int) -> int: ...
    def GetOutBit(self, byte: int, bit: int) -> tuple[int, int]: ...
    @staticmethod
    def ErrorToString(code: int) -> str: ...


class Ecat(Protocol):
    def ScanNetwork(self, masterId: int = 0) -> int: ...

    @staticmethod
    def ErrorToString(code: int) -> str: ...
