"""The calls of the port, one table per object of the vendor's module, and the object that carries them out.

A call answers a code, or a code and values. ``values`` names the types of the values; on failure they are zero values.
``enums`` are arguments that are entries of an enumeration, by position. ``needed`` calls must be there: the library is
refused without them when it is loaded; any other that a version lacks answers NoSupportedFunction. ``also`` are names
of the call in other versions. ``plain`` calls answer a value and no code. ``unfit`` is the code for a number that the
vendor's argument type cannot hold.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Final

from robot_stack.wmx.api.enums import AxisCommandMode, DeviceType, EStopLevel
from robot_stack.wmx.api.errors import ErrorCode
from robot_stack.wmx.api.parameters import (
    Config_AlarmParam,
    Config_AxisParam,
    Config_EmergencyStopParam,
    Config_FeedbackParam,
    Config_HomeParam,
    Config_LimitParam,
    Config_MotionParam,
    Config_SystemParam,
)
from robot_stack.wmx.api.status import CoreMotionStatus, DevicesInfo, EcMasterInfo, EngineStatus
from robot_stack.wmx.vendor.records import MissingField, Records

WRONG_ARGUMENTS: Final = (TypeError, NotImplementedError)
"""What the vendor's wrapper raises for arguments that it does not take; the second one for overloaded calls."""


_LEAST, _GREATEST = -(1 << 31), (1 << 32) - 1


@dataclass(frozen=True, slots=True)
class Call:
    """How one call looks; see the module."""

    values: tuple[Any, ...] = ()
    enums: Mapping[int, type[IntEnum]] = field(default_factory=dict)
    needed: bool = False
    also: tuple[str, ...] = ()
    plain: bool = False
    unfit: int = ErrorCode.ArgumentOutOfRange


Calls = Mapping[str, Call]
_COMMAND, _NEEDED, _VALUE, _REAL = Call(), Call(needed=True), Call((int,)), Call((float,))

API: Final[Calls] = {
    "CreateDevice": Call(enums={1: DeviceType}, needed=True),
    "CloseDevice": _NEEDED,
    "IsDeviceValid": Call((bool,), plain=True, needed=True),
    "StartEngine": _COMMAND,
    "StopEngine": _COMMAND,
    "RestartEngine": _COMMAND,
    "StartCommunication": _NEEDED,
    "StopCommunication": _NEEDED,
    "GetEngineStatus": Call((EngineStatus,), needed=True),
    "SetDeviceName": _NEEDED,
    "GetDeviceName": Call((str,)),
    "GetDeviceID": _VALUE,
    "GetAllDevices": Call((DevicesInfo,)),
    "SetWatchdog": _COMMAND,
    "GetWatchdog": Call((int, int)),
    "ResetWatchdogTimer": _COMMAND,
    "AutoQuitWithoutActiveDev": _COMMAND,
}
CORE_MOTION: Final[Calls] = {
    "GetStatus": Call((CoreMotionStatus,), needed=True),
    "ExecEStop": Call(enums={0: EStopLevel}, needed=True),
    "ReleaseEStop": _NEEDED,
}
AXIS_CONTROL: Final[Calls] = {
    "SetServoOn": _NEEDED,
    "SetServoOn_AxisSel": _COMMAND,
    "ClearAmpAlarm": _NEEDED,
    "ClearAmpAlarm_AxisSel": _COMMAND,
    "ClearAxisAlarm": _COMMAND,
    "ClearAxisAlarm_AxisSel": _COMMAND,
    "SetAxisCommandMode": Call(enums={1: AxisCommandMode}, needed=True),
    "GetAxisCommandMode": Call((AxisCommandMode,)),
    "GetPosCommand": _REAL,
    "GetPosFeedback": _REAL,
    "GetVelCommand": _REAL,
    "GetVelFeedback": _REAL,
}
_STOPS: Final[Calls] = {
    "Stop": _NEEDED,
    "Stop_AxisSel": _COMMAND,
    "ExecQuickStop": _NEEDED,
    "ExecQuickStop_AxisSel": _COMMAND,
    "ExecTimedStop_TimeMilli": _COMMAND,
    "ExecTimedStop_AxisSel": _COMMAND,
}
MOTION: Final[Calls] = {
    **_STOPS,
    "StartPos": _NEEDED,
    "StartMov": _NEEDED,
    "StartJog": _COMMAND,
    "StartJog_TimedJog": _COMMAND,
    "Stop_Dec": _COMMAND,
}
VELOCITY: Final[Calls] = {**_STOPS, "StartVel": _NEEDED, "StartVel_TimedVel": _COMMAND}
HOME: Final[Calls] = {
    "StartHome": _COMMAND,
    "StartHome_AxisSel": _COMMAND,
    "Cancel": _COMMAND,
    "SetCommandPos": _COMMAND,
    "SetFeedbackPos": _COMMAND,
    "SetHomeDone": _COMMAND,
}
BLOCKS: Final = {
    "FeedbackParam": Config_FeedbackParam,
    "HomeParam": Config_HomeParam,
    "LimitParam": Config_LimitParam,
    "MotionParam": Config_MotionParam,
    "AlarmParam": Config_AlarmParam,
    "EmergencyStopParam": Config_EmergencyStopParam,
}
"""Parameter blocks that are read, changed and written back; their setters are the adapter's own."""
CONFIG: Final[Calls] = {
    "SetGearRatio": _COMMAND,
    "GetGearRatio": Call((float, float)),
    "SetAxisPolarity": _COMMAND,
    "GetAxisPolarity": _VALUE,
    **{f"Get{name}": Call((kind,)) for name, kind in BLOCKS.items()},
    "GetParam": Call((Config_SystemParam,)),
    "GetAxisParam": Call((Config_AxisParam,)),
    "ImportAndSetAll": _COMMAND,
    "GetAndExportAll": _COMMAND,
}
_CHANNEL = ErrorCode.ChannelOutOfRange
ADV_MOTION: Final[Calls] = {
    "CreateSplineBuffer": Call(unfit=_CHANNEL),
    "FreeSplineBuffer": Call(unfit=_CHANNEL),
    "GetSplineBufferPoints": Call((int,), unfit=_CHANNEL),
    "StartCSplinePos_PointTime": Call(also=("StartCSplinePos",), unfit=_CHANNEL),
}
IO: Final[Calls] = {
    "SetOutBit": _NEEDED,
    "GetOutBit": Call((int,), needed=True),
    "GetInBit": Call((int,), needed=True),
    "SetOutByte": _COMMAND,
    "GetOutByte": _VALUE,
    "GetInByte": _VALUE,
    "SetOutBytes": _COMMAND,
    "GetOutBytes": Call((list[int],), needed=True),
    "GetInBytes": Call((list[int],), needed=True),
}
ECAT: Final[Calls] = {
    "ScanNetwork": _COMMAND,
    "GetMasterInfo": Call((EcMasterInfo,)),
    "RegisterRead": Call((list[int],)),
    "ResetTransmitStatisticsInfo": _COMMAND,
    "StartHotconnect": _COMMAND,
}


def found(theirs: Any, name: str, call: Call) -> Callable[..., Any] | None:
    """The vendor's method of a call under any of its names."""
    for one in (name, *call.also):
        method = getattr(theirs, one, None)
        if callable(method):
            return method  # type: ignore[no-any-return]
    return None


def missing(theirs: Any, calls: Calls) -> list[str]:
    """The needed calls that the vendor's object lacks."""
    return [name for name, call in calls.items() if call.needed and found(theirs, name, call) is None]


class Member:
    """One object of the vendor's module with the calls of one table as its methods."""

    def __init__(self, theirs: Any, calls: Calls, records: Records) -> None:
        self.theirs = theirs
        self.records = records
        for name, call in calls.items():
            if not hasattr(type(self), name):
                setattr(self, name, self.bound(name, call))

    def bound(self, name: str, call: Call) -> Callable[..., Any]:
        """The call ``name`` in the port's shape."""
        method = found(self.theirs, name, call)

        def run(*arguments: Any) -> Any:
            if method is None:
                return self.answer(call, ErrorCode.NoSupportedFunction)
            try:
                sent = self.sent(call, arguments)
                # An overloaded call of the wrapper does not say that a number is too large for its argument.
                if any(isinstance(value, int) and not _LEAST <= value <= _GREATEST for value in sent):
                    return self.answer(call, call.unfit)
                return self.received(call, method(*sent))
            except OverflowError:
                return self.answer(call, call.unfit)
            except MissingField:
                return self.answer(call, ErrorCode.NoSupportedFunction)

        return run

    def sent(self, call: Call, arguments: tuple[Any, ...]) -> list[Any]:
        """The arguments as the vendor takes them. Raises MissingField."""
        sent = [self.records.theirs(argument) for argument in arguments]
        for position, kind in call.enums.items():
            if position < len(sent):
                sent[position] = self.records.enum(kind).theirs(sent[position])
        return sent

    def received(self, call: Call, result: Any) -> Any:
        """The vendor's answer in the port's shape."""
        if call.plain:
            return call.values[0](result)
        code, *values = result if isinstance(result, (tuple, list)) else (result,)
        code = self.records.errors.ours(int(code))
        if code or not call.values:
            return self.answer(call, code)
        converted = (self.records.ours(kind, value) for kind, value in zip(call.values, values, strict=True))
        return code, *converted

    @staticmethod
    def answer(call: Call, code: int) -> Any:
        """An answer of a code and zero values."""
        if call.plain:
            return call.values[0]()
        return (code, *(_zero(kind) for kind in call.values)) if call.values else code


def _zero(kind: Any) -> Any:
    if isinstance(kind, type) and issubclass(kind, IntEnum):
        return 0
    return [] if kind == list[int] else kind()
