"""Replaces the vendor's Python module: its interface from published facts, its behaviour from the simulated engine.

``fill(globals())`` makes a module of it. ``CONTROL.calls`` records every call. ``CONTROL.faults`` records wrong calls
(a field that does not exist, a command with fields left out, a list shorter than its count), and ``CONTROL.disorder``
records calls out of order (motion without a device or without communication, a closed device used). It uses no code of
the adapter. Paths of CreateDevice are runtime folders of simulated engines.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from enum import IntEnum
from typing import Any, Final, get_args, get_origin, get_type_hints

from robot_stack.wmx import api as port
from robot_stack.wmx.api.surface import Call, Commands, Listed, Plain
from robot_stack.wmx.simulated.library import simulated_library
from tests.support.wmx.status_records import CoreMotionAxisStatus, CoreMotionStatus
from tests.support.wmx.swig import BOOL, DOUBLE, INT, STR, UCHAR, UINT, CType, ListOf, Of, Proxy, c_array, plain, proxy
from tests.support.wmx.swig import taken as take

N_AXES: Final = 128
MAX_DIMENSIONS: Final = 6
C_TYPES: Final = {
    Plain.INT: INT,
    Plain.AXIS: INT,
    Plain.UINT: UINT,
    Plain.UCHAR: UCHAR,
    Plain.DOUBLE: DOUBLE,
    Plain.TEXT: STR,
}
PLAIN: Final = {int: INT, float: DOUBLE, bool: BOOL, str: STR}
VENDOR_ONLY: Final = {
    "Config_HomeParam": {"homingVelocityFast": DOUBLE, "homeDirection": INT, "openLoopHoming": BOOL},
    "Config_LimitParam": {"nearLSType": INT},
    "Config_MotionParam": {"interruptedIntplUseQuickStop": BOOL},
    "CoreMotionAxisStatus": {"nearPositiveLS": BOOL, "axisCommandModeFeedback": INT, "homePaused": BOOL},
}
"""Fields that only the vendor has: the adapter must preserve them when it changes a block."""
ENUMS: Final = tuple(kind for kind in vars(port).values() if isinstance(kind, type) and issubclass(kind, IntEnum))
ERRORS: Final = ("CoreMotionErrorCode", "AdvancedMotionErrorCode", "EcErrorCode")


@dataclass(frozen=True)
class Variant:
    """A version of the module. ``inserted``: by enumeration, the number at which newer headers insert an entry."""

    io: str = "Io"
    ecat_takes_master: bool = False
    spline_times: str = "list"
    spline_call: str = "StartCSplinePos_PointTime"
    inserted: Mapping[str, int] = field(default_factory=dict)
    without: tuple[str, ...] = ()


V35: Final = Variant()
V35_UINT: Final = Variant(spline_times="uintArray")
NEWER: Final = Variant(
    io="IO",
    ecat_takes_master=True,
    spline_times="doubleArray",
    inserted={
        "ErrorCode": 1540,
        "CoreMotionErrorCode": 65546,
        "AdvancedMotionErrorCode": 94200,
        "EcErrorCode": 8190,
        "OperationState": 1,
        "AxisCommandMode": 1,
        "ProfileType": 1,
        "Config_HomeType": 2,
        "Config_LimitSwitchType": 2,
        "EngineState": 2,
    },
)
VARIANTS: Final = {"3.5": V35, "3.5 with whole milliseconds": V35_UINT, "newer": NEWER}


@dataclass
class Control:
    """Records for the tests, and switches that break the engine. ``frozen``: fixed value of the cycle counter."""

    calls: list[tuple[str, tuple[Any, ...]]] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    disorder: list[str] = field(default_factory=list)
    frozen: int | None = None
    patience_s: float = 10.0

    def named(self, name: str) -> list[tuple[Any, ...]]:
        """The arguments of every call of ``name``."""
        return [arguments for called, arguments in self.calls if called == name]


class Numbers:
    """The numbers of a variant: those of the port with inserted entries."""

    def __init__(self, variant: Variant) -> None:
        self._inserted = variant.inserted

    def vendor(self, kind: type[IntEnum], number: int) -> int:
        return number + (kind.__name__ in self._inserted and number >= self._inserted[kind.__name__])

    def port(self, kind: type[IntEnum], number: int) -> int:
        inserted = self._inserted.get(kind.__name__)
        return number - (inserted is not None and number > inserted)

    def code(self, number: int) -> int:
        """The vendor's number of one of the simulated engine's error codes."""
        for kind in (port.ErrorCode, *(getattr(port, name) for name in ERRORS)):
            if number in kind._value2member_map_:
                return self.vendor(kind, number)
        return number

    def port_code(self, number: int) -> int:
        for kind in (port.ErrorCode, *(getattr(port, name) for name in ERRORS)):
            candidate = self.port(kind, number)
            if candidate in kind._value2member_map_ and self.vendor(kind, candidate) == number:
                return candidate
        return -1


class Classes:
    """The value classes and enumerations of a variant."""

    def __init__(self, variant: Variant, control: Control) -> None:
        self.variant, self.control, self.numbers = variant, control, Numbers(variant)
        self.made: dict[str, Any] = {}
        self._enumerations()
        self._commands()
        for name in ("EngineStatus", "DeviceInfo", "DevicesInfo"):
            self.of(getattr(port, name))
        for name in (name for name in vars(port) if name.startswith("Config_") and name.endswith("Param")):
            self.of(getattr(port, name))
        self.of(CoreMotionAxisStatus)
        axis = self.made["CoreMotionAxisStatus"]
        self.made["CoreMotionStatus"] = proxy(
            control,
            "CoreMotionStatus",
            {
                "invalidLicenseError": BOOL,
                "engineState": INT,
                "numOfInterrupts": INT,
                "emergencyStop": BOOL,
                "emergencyStopLevel": INT,
            },
            {"cycleTimeMilliseconds": (DOUBLE, 2), "cycleCounter": (INT, 2), "axesStatus": (Of(axis), N_AXES)},
        )
        self.made["doubleArray"] = c_array("doubleArray", DOUBLE)
        self.made["uintArray"] = c_array("uintArray", UINT)

    def _enumerations(self) -> None:
        for kind in sorted(ENUMS, key=lambda kind: kind.__name__ in ERRORS):  # their base class must exist first
            entries = {member.name: self.numbers.vendor(kind, int(member)) for member in kind}
            inserted = self.variant.inserted.get(kind.__name__)
            if inserted is not None:
                entries["EntryOfANewerVersion"] = inserted
            base = (self.made["ErrorCode"],) if kind.__name__ in ERRORS else ()
            self.made[kind.__name__] = type(kind.__name__, base, entries)

    def _commands(self) -> None:
        make = lambda name, *tables: proxy(self.control, name, *tables)  # noqa: E731
        reals = ("velocity", "acc", "dec", "jerkAcc", "jerkDec", "jerkAccRatio", "jerkDecRatio", "accTimeMilliseconds")
        reals += ("decTimeMilliseconds", "startingVelocity", "endVelocity", "secondVelocity")
        profile = make(
            "Profile", {"type": INT, **dict.fromkeys(reals, DOUBLE), "movingAverageTimeMilliseconds": DOUBLE}
        )
        endless: dict[str, CType] = {"axis": INT, "profile": Of(profile)}
        timed: dict[str, CType] = {"axis": INT, "runTimeMilliseconds": DOUBLE, "profile": Of(profile)}
        self.made |= {
            "Profile": profile,
            "Motion_PosCommand": make("Motion_PosCommand", {"axis": INT, "target": DOUBLE, "profile": Of(profile)}),
            "Velocity_VelCommand": make("Velocity_VelCommand", endless),
            "Velocity_TimedVelCommand": make("Velocity_TimedVelCommand", timed),
            "AxisSelection": make("AxisSelection", {"axisCount": INT}, {"axis": (INT, N_AXES)}),
            "AdvMotion_SplinePoint": make("AdvMotion_SplinePoint", {}, {"pos": (DOUBLE, MAX_DIMENSIONS)}),
            "AdvMotion_PointTimeSplineCommand": make(
                "AdvMotion_PointTimeSplineCommand", {"dimensionCount": UINT}, {"axis": (INT, MAX_DIMENSIONS)}
            ),
        }

    def of(self, kind: type) -> type[Proxy]:
        """The class of a record, with the port's field names and the vendor's own."""
        name = kind.__name__
        if name in self.made:
            found: type[Proxy] = self.made[name]
            return found
        single: dict[str, CType] = dict(VENDOR_ONLY.get(name, {}))
        arrays: dict[str, tuple[CType, int]] = {}
        for item, hint in get_type_hints(kind).items():
            if get_origin(hint) is list:
                (entry,) = get_args(hint)
                arrays[item] = (Of(self.of(entry)) if is_dataclass(entry) else PLAIN[entry], N_AXES)
            else:
                single[item] = Of(self.of(hint)) if is_dataclass(hint) else PLAIN[hint]
        self.made[name] = proxy(self.control, name, single, arrays)
        return self.made[name]  # type: ignore[no-any-return]

    # -- between the vendor's objects and the simulated engine's records ----------------------------------------------

    def vendor(self, value: Any) -> Any:
        """A record of the simulated engine as the vendor's object."""
        if isinstance(value, IntEnum):
            return self.numbers.vendor(type(value), int(value))
        if not is_dataclass(value):
            return value
        made = self.of(type(value))()
        for item in fields(value):
            entry = getattr(value, item.name)
            kind = type(item.default)
            if isinstance(entry, list):
                for index, one in enumerate(entry):
                    made.arrays[item.name][index] = self.vendor(one)
            elif issubclass(kind, IntEnum):
                made.values[item.name] = self.numbers.vendor(kind, int(entry))
            else:
                made.values[item.name] = self.vendor(entry)
        return made

    def status(self, value: CoreMotionStatus) -> Any:
        """The status record."""
        made = self.made["CoreMotionStatus"]()
        for name in type(made).FIELDS:
            made.values[name] = getattr(value, name)
        made.values["engineState"] = self.numbers.vendor(port.EngineState, int(value.engineState))
        made.arrays["cycleTimeMilliseconds"] = list(value.cycleTimeMilliseconds)
        made.arrays["cycleCounter"] = list(value.cycleCounter)
        if self.control.frozen is not None:
            made.arrays["cycleCounter"][0] = self.control.frozen
        n_axes = len(value.axesStatus)
        made.arrays["axesStatus"] = [self.vendor(record) for record in value.axesStatus]
        made.arrays["axesStatus"] += [self.vendor(CoreMotionAxisStatus())] * (N_AXES - n_axes)
        return made

    def port(self, value: Any, n_axes: int = N_AXES) -> Any:
        """Converts an argument for the simulated engine. Unset fields of a command are recorded as a fault."""
        if isinstance(value, list):
            return [self.port(item) for item in value]
        if not isinstance(value, Proxy):
            return value
        name = type(value).__name__
        kind = getattr(port, name)
        if name == "AxisSelection":
            return port.AxisSelection(
                value.values["axisCount"], list(value.arrays["axis"][: value.values["axisCount"]])
            )
        made = kind()
        for item in fields(kind):
            if item.name in value.arrays:
                size = value.values.get("dimensionCount", n_axes)
                setattr(made, item.name, list(value.arrays[item.name][:size]))
                continue
            entry = self.port(value.values[item.name])
            default = type(item.default)
            if issubclass(default, IntEnum):
                entry = self.numbers.port(default, entry)
            setattr(made, item.name, entry)
        if name.startswith(("Motion_", "Velocity_")):
            self._complete(value, kind)
        return made

    def _complete(self, value: Proxy, kind: type) -> None:
        for item in fields(kind):  # type: ignore[arg-type]
            if item.name != "profile" and item.name not in value.written:
                self.control.faults.append(f"{kind.__name__}.{item.name} was never written")
        left = {"type", "velocity", "acc", "dec", "accTimeMilliseconds"} - value.values["profile"].written
        for name in sorted(left):
            self.control.faults.append(f"{kind.__name__}.profile.{name} was never written")


Overloads = Sequence[Sequence[CType]]


class Device:
    """Common state of the fake's objects of one device: the simulated device and whether it is open."""

    def __init__(self, control: Control) -> None:
        self.library = simulated_library(control.patience_s, control.patience_s)
        self.api = self.library.WMX3Api()
        self.created = self.closed = False

    def communicating(self) -> bool:
        code, status = self.api.GetEngineStatus()
        return not code and status.state == port.EngineState.Communicating


class Builder:
    """Makes the module's classes."""

    def __init__(self, variant: Variant, control: Control) -> None:
        self.variant, self.control = variant, control
        self.classes = Classes(variant, control)
        self.extras: dict[tuple[str, int], dict[str, Any]] = {}

    def method(self, owner: str, name: str, call: Call) -> Callable[..., Any]:
        """A call of the interface that the simulated engine executes."""
        numbers = self.classes.numbers

        def run(this: Any, *arguments: Any) -> Any:
            given = self.asked(owner, name, call, this, arguments)
            for position, kind in enumerate(call.takes[: len(given)]):
                if isinstance(kind, type) and issubclass(kind, IntEnum):
                    given[position] = numbers.port(kind, given[position])
            answer = getattr(this.sim, name)(*[self.classes.port(value) for value in given])
            return self.answer(answer, call)

        return run

    def asked(self, owner: str, name: str, call: Call, this: Any, arguments: tuple[Any, ...]) -> list[Any]:
        """Checks and records a call of the interface; returns the converted arguments."""
        ordered = "bus" if call.bus else "" if name in ("IsDeviceValid", "CreateDevice") else "device"
        return self.called(owner, name, self.overloads(call), this, arguments, ordered)

    def overloads(self, call: Call) -> Overloads:
        """The C types of a call's arguments."""
        if call.takes and isinstance(call.takes[0], Commands):
            command = Of(self.classes.made[call.takes[0].kind.__name__])
            return ((command,), (INT, ListOf(command)))
        kinds = tuple(self._ctype(kind) for kind in call.takes)
        return tuple(kinds[: len(kinds) - missing] for missing in range(call.optional, -1, -1))

    def _ctype(self, kind: Any) -> CType:
        if isinstance(kind, Listed):
            return ListOf(self._ctype(kind.kind))
        if isinstance(kind, Plain):
            return C_TYPES[kind]
        return INT if issubclass(kind, IntEnum) else Of(self.classes.made[kind.__name__])

    def called(
        self, owner: str, name: str, overloads: Overloads, this: Any, arguments: tuple[Any, ...], ordered: str
    ) -> list[Any]:
        """Checks and records a call; returns the converted arguments."""
        given = take(name, overloads, arguments)
        full = f"{owner}.{name}"
        self.control.calls.append((full, tuple(plain(value) for value in given)))
        if ordered and not this.device.created:
            self.control.disorder.append(
                f"{full} {'after CloseDevice' if this.device.closed else 'before CreateDevice'}"
            )
        elif ordered == "bus" and not this.device.communicating():
            self.control.disorder.append(f"{full} before StartCommunication")
        counted = len(given) == 2 and isinstance(given[0], int) and isinstance(given[1], list)
        if counted and given[0] > len(given[1]):
            self.control.faults.append(f"{full}: {given[0]} commands of a list of {len(given[1])}")
        return given

    def answer(self, result: Any, call: Call | None = None) -> Any:
        """Converts a result of the simulated engine into the vendor's numbers and objects."""
        if isinstance(result, tuple):
            code, *values = result
            kinds = call.values if call is not None and not code else ()
            for place, kind in enumerate(kinds):
                if isinstance(kind, type) and issubclass(kind, IntEnum):
                    values[place] = self.classes.numbers.vendor(kind, values[place])
            return (self.classes.numbers.code(int(code)), *(self.classes.vendor(value) for value in values))
        return result if isinstance(result, (bool, str)) else self.classes.numbers.code(int(result))

    def text(self, owner: str) -> Any:
        """ErrorToString of one module: a static method with texts for its own codes and the base's."""

        def run(code: Any) -> str:
            self.control.calls.append((f"{owner}.ErrorToString", (INT.take(code),)))
            number = self.classes.numbers.port_code(code)
            kinds = {
                "WMX3Api": (port.ErrorCode,),
                "CoreMotion": (port.CoreMotionErrorCode, port.ErrorCode),
                "AdvancedMotion": (port.AdvancedMotionErrorCode, port.CoreMotionErrorCode, port.ErrorCode),
                "Ecat": (port.EcErrorCode, port.ErrorCode),
            }.get(owner, (port.ErrorCode,))
            return port.error_text(number, *kinds)

        return staticmethod(run)
