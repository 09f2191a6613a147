"""The surface of the engine as tables, one per object of the vendor's module: arguments and results of every call.

The protocols of ``port`` declare the same for a type checker. The client of the simulated engine, the requests of its
server and the vendor adapter are made from these tables; so are the tests' vendor module and their call lists.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, IntEnum
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


class Plain(Enum):
    """Numbers and texts, by the types of the vendor's C++ header. AXIS is an int that names one axis."""

    INT = int
    UINT = "unsigned"
    UCHAR = "byte"
    DOUBLE = float
    TEXT = str
    AXIS = "axis"


@dataclass(frozen=True, slots=True)
class Commands:
    """One command of a kind, or a count and a list that is as long at least; in one call all of them or none."""

    kind: type


@dataclass(frozen=True, slots=True)
class Listed:
    """A list, whose length is an argument before it."""

    kind: Any


Kind = Plain | Commands | Listed | type
"""The kind of an argument: plain, commands, an enumeration, or a record."""


@dataclass(frozen=True, slots=True)
class Call:
    """takes: the arguments; the last ``optional`` of them may be left out. values: the types of the results beside
    a code; on failure they are zero values. plain: it returns a value and no code. echo: the last argument is returned,
    too. also: names of the call in other versions. unfit: the code for a number that the argument's type cannot hold.

    needed: the vendor's library is rejected at loading without it; any other call that a version lacks returns
    NoSupportedFunction. bus: it needs communication. own: the client of the simulated engine implements it
    itself.
    """

    takes: tuple[Kind, ...] = ()
    values: tuple[Any, ...] = ()
    optional: int = 0
    needed: bool = False
    plain: bool = False
    echo: bool = False
    also: tuple[str, ...] = ()
    unfit: int = ErrorCode.ArgumentOutOfRange
    bus: bool = False
    own: bool = False

    def zero(self, code: int, *echoed: Any) -> Any:
        """An answer of a code and zero values."""
        if self.plain:
            return self.values[0]()
        values = (*(zero_of(kind) for kind in self.values), *(echoed if self.echo else ()))
        return (code, *values) if values else code


def zero_of(kind: Any) -> Any:
    """The value that is answered with a code other than 0."""
    return 0 if isinstance(kind, type) and issubclass(kind, IntEnum) else kind()


def one_or_many(command: Any, commands: Sequence[Any] | None = None) -> list[Any] | None:
    """The commands of a call that takes ``Commands``; None if the list is shorter than the count."""
    if commands is None:
        return None if isinstance(command, int) else [command]
    count = operator.index(command)
    return list(commands[:count]) if 0 <= count <= len(commands) else None


Table = Mapping[str, Call]
_P, _AXIS, _ALL = Plain, (Plain.AXIS,), (AxisSelection,)


def _on_axes(name: str, *more: Kind, needed: bool = False) -> dict[str, Call]:
    """A call for one axis, and its overload for a selection."""
    return {
        name: Call((*_AXIS, *more), needed=needed, bus=True),
        f"{name}_AxisSel": Call((*_ALL, *more), bus=True),
    }


API: Final[Table] = {
    "CreateDevice": Call((_P.TEXT, DeviceType, _P.UINT), optional=2, needed=True, own=True),
    "CloseDevice": Call(needed=True, own=True),
    "IsDeviceValid": Call(values=(bool,), plain=True, needed=True, own=True),
    "StopEngine": Call((_P.UINT,), optional=1, own=True),
    "StartCommunication": Call((_P.UINT,), optional=1, needed=True, own=True),
    "StopCommunication": Call((_P.UINT,), optional=1, needed=True),
    "GetEngineStatus": Call(values=(EngineStatus,), needed=True, own=True),
    "SetDeviceName": Call((_P.TEXT,), needed=True),
    "GetDeviceName": Call(values=(str,)),
    "GetDeviceID": Call(values=(int,), own=True),
    "GetAllDevices": Call(values=(DevicesInfo,)),
}
CORE_MOTION: Final[Table] = {
    "ExecEStop": Call((EStopLevel,), needed=True),
    "ReleaseEStop": Call(needed=True),
}
AXIS_CONTROL: Final[Table] = {
    **_on_axes("SetServoOn", _P.INT, needed=True),
    **_on_axes("ClearAmpAlarm", needed=True),
    **_on_axes("ClearAxisAlarm"),
    "SetAxisCommandMode": Call((_P.INT, AxisCommandMode), needed=True),
    "GetAxisCommandMode": Call((_P.INT,), values=(AxisCommandMode,), own=True),
}
_STOPS: Final[Table] = {**_on_axes("Stop", needed=True), **_on_axes("ExecQuickStop", needed=True)}
MOTION: Final[Table] = {
    **_STOPS,
    "StartPos": Call((Commands(Motion_PosCommand),), needed=True, bus=True),
    "StartMov": Call((Commands(Motion_PosCommand),), needed=True, bus=True),
}
VELOCITY: Final[Table] = {
    **_STOPS,
    "StartVel": Call((Commands(Velocity_VelCommand),), needed=True, bus=True),
    "StartVel_TimedVel": Call((Commands(Velocity_TimedVelCommand),), needed=True, bus=True),
}
HOME: Final[Table] = {
    "StartHome": Call(_AXIS, bus=True),
    "Cancel": Call((_P.INT,)),
    "SetCommandPos": Call((_P.INT, _P.DOUBLE), bus=True),
}
BLOCKS: Final[Mapping[str, type]] = {
    "FeedbackParam": Config_FeedbackParam,
    "HomeParam": Config_HomeParam,
    "LimitParam": Config_LimitParam,
    "MotionParam": Config_MotionParam,
    "AlarmParam": Config_AlarmParam,
}
"""Parameter blocks of an axis, which are read, changed and written back."""
ENGINE_BLOCK: Final = "EmergencyStopParam"
"""The block that the engine has once."""
CONFIG: Final[Table] = {
    "SetGearRatio": Call((_P.INT, _P.DOUBLE, _P.DOUBLE)),
    "GetGearRatio": Call((_P.INT,), values=(float, float)),
    "SetAxisPolarity": Call((_P.INT, _P.INT)),
    "GetAxisPolarity": Call((_P.INT,), values=(int,)),
    **{f"Get{name}": Call((_P.INT,), values=(kind,)) for name, kind in BLOCKS.items()},
    **{f"Set{name}": Call((_P.INT, kind), echo=True) for name, kind in BLOCKS.items()},
    f"Get{ENGINE_BLOCK}": Call(values=(Config_EmergencyStopParam,)),
    f"Set{ENGINE_BLOCK}": Call((Config_EmergencyStopParam,), echo=True),
    "GetAxisParam": Call(values=(Config_AxisParam,)),
    "ImportAndSetAll": Call((_P.TEXT,), own=True),
    "GetAndExportAll": Call((_P.TEXT,), own=True),
}
_CHANNEL: Final = ErrorCode.ChannelOutOfRange
ADV_MOTION: Final[Table] = {
    "CreateSplineBuffer": Call((_P.UINT, _P.UINT), unfit=_CHANNEL),
    "FreeSplineBuffer": Call((_P.UINT,), unfit=_CHANNEL),
    "GetSplineBufferPoints": Call((_P.UINT,), values=(int,), unfit=_CHANNEL),
    "StartCSplinePos_PointTime": Call(
        (
            _P.UINT,
            AdvMotion_PointTimeSplineCommand,
            _P.UINT,
            Listed(AdvMotion_SplinePoint),
            Listed(_P.DOUBLE),
        ),
        also=("StartCSplinePos",),
        unfit=_CHANNEL,
        bus=True,
        own=True,
    ),
}
IO: Final[Table] = {
    "SetOutBit": Call((_P.INT, _P.INT, _P.UCHAR), needed=True),
    "GetOutBit": Call((_P.INT, _P.INT), values=(int,), needed=True, own=True),
}
ECAT: Final[Table] = {"ScanNetwork": Call((_P.INT,), optional=1)}

SURFACE: Final[Mapping[str, Table]] = {
    "WMX3Api": API,
    "CoreMotion": CORE_MOTION,
    "axisControl": AXIS_CONTROL,
    "motion": MOTION,
    "velocity": VELOCITY,
    "home": HOME,
    "config": CONFIG,
    "advMotion": ADV_MOTION,
    "Io": IO,
    "Ecat": ECAT,
}
"""By the names of the vendor's classes and their members."""
