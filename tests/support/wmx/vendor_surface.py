"""The classes of the vendor's module with their calls: C types of the arguments as published, one row per call.

``fill(globals(), variant, control)`` makes a module of them; see vendor_fake for what they do.
"""

from __future__ import annotations

from typing import Any, Final

from robot_stack.wmx import api as port
from tests.support.wmx.swig import BOOL, DOUBLE, INT, STR, UCHAR, UINT, CType, ListOf, Of
from tests.support.wmx.swig import taken as take
from tests.support.wmx.vendor_fake import BLOCKS, VENDOR_ONLY, Builder, Control, Device, Overloads, Variant

NONE: Final[Overloads] = ((),)
AXIS: Final[Overloads] = ((INT,),)
API: Final[dict[str, Overloads]] = {
    "CloseDevice": NONE,
    "IsDeviceValid": NONE,
    "StartEngine": ((STR,), (STR, UINT)),
    "StopEngine": ((), (UINT,)),
    "RestartEngine": ((STR,), (STR, UINT)),
    "StartCommunication": ((), (UINT,)),
    "StopCommunication": ((), (UINT,)),
    "GetEngineStatus": NONE,
    "SetDeviceName": ((STR,),),
    "GetDeviceName": NONE,
    "GetDeviceID": NONE,
    "GetAllDevices": NONE,
    "SetWatchdog": ((UINT,),),
    "GetWatchdog": NONE,
    "ResetWatchdogTimer": NONE,
    "AutoQuitWithoutActiveDev": ((BOOL,),),
}
WITHOUT_DEVICE: Final = ("IsDeviceValid", "StartEngine")
HOME: Final[dict[str, Overloads]] = {
    "StartHome": AXIS,
    "Cancel": AXIS,
    "SetCommandPos": ((INT, DOUBLE),),
    "SetFeedbackPos": ((INT, DOUBLE),),
    "SetHomeDone": ((INT, UCHAR),),
}
CONFIG: Final[dict[str, Overloads]] = {
    "SetGearRatio": ((INT, DOUBLE, DOUBLE),),
    "GetGearRatio": AXIS,
    "SetAxisPolarity": ((INT, INT),),
    "GetAxisPolarity": AXIS,
    "GetParam": ((), (INT,)),
    "GetAxisParam": ((), (INT,)),
    "ImportAndSetAll": ((STR,),),
    "GetAndExportAll": ((STR,),),
}
IO: Final[dict[str, Overloads]] = {
    "SetOutBit": ((INT, INT, UCHAR),),
    "GetOutBit": ((INT, INT),),
    "GetInBit": ((INT, INT),),
    "SetOutByte": ((INT, UCHAR),),
    "GetOutByte": AXIS,
    "GetInByte": AXIS,
    "SetOutBytes": ((INT, INT, ListOf(UCHAR)),),
    "GetOutBytes": ((INT, INT),),
    "GetInBytes": ((INT, INT),),
}
ECAT: Final[dict[str, tuple[CType, ...]]] = {
    "ScanNetwork": (),
    "GetMasterInfo": (),
    "RegisterRead": (INT, INT, INT),
    "ResetTransmitStatisticsInfo": (),
    "StartHotconnect": (),
}
SPLINES: Final[dict[str, Overloads]] = {
    "CreateSplineBuffer": ((UINT, UINT),),
    "FreeSplineBuffer": ((UINT,),),
    "GetSplineBufferPoints": ((UINT,),),
}


def fill(module: dict[str, Any], variant: Variant, control: Control) -> None:
    """Puts the classes of a variant into a module's namespace."""
    builder = Builder(variant, control)
    made = builder.classes.made
    device = _device(builder)
    members = {
        "axisControl": _table(builder, "axisControl", _axis_control(made), "bus"),
        "motion": _motion(builder, "motion"),
        "velocity": _motion(builder, "velocity"),
        "home": _table(builder, "home", {**HOME, "StartHome_AxisSel": ((Of(made["AxisSelection"]),),)}, "bus"),
        "config": _config(builder),
    }
    for name in ("Cancel", "SetHomeDone"):  # they need no bus
        setattr(members["home"], name, builder.method("home", name, HOME[name], "device"))
    module |= made
    module["CONTROL"] = control
    module["VARIANT"] = variant
    module["WMX3Api"] = device
    module["CoreMotion"] = _core_motion(builder, device, members)
    module[variant.io] = _io(builder, device)
    module["Ecat"] = _ecat(builder, device)
    module["AdvancedMotion"] = _advanced_motion(builder, device)
    for name in variant.without:
        owner, _, member = name.partition(".")
        if member:
            delattr(members.get(owner, module.get(owner)), member)
        else:
            del module[name]


def _table(builder: Builder, owner: str, table: dict[str, Overloads], ordered: str) -> type:
    """A class whose calls are rows of a table, on the simulated engine's object of the same name."""

    def init(self: Any, device: Device, sim: Any) -> None:
        self.device, self.sim = device, sim

    calls = {name: builder.method(owner, name, overloads, ordered) for name, overloads in table.items()}
    return type(owner, (), {"__init__": init, **calls})


def _device(builder: Builder) -> type:
    def init(self: Any) -> None:
        self.device = Device(builder.control)
        self.sim = self.device.api

    def create(self: Any, *arguments: Any) -> int:
        given = builder.called("WMX3Api", "CreateDevice", ((STR,), (STR, INT), (STR, INT, UINT)), self, arguments, "")
        if len(given) > 1:
            given[1] = builder.classes.numbers.port(port.DeviceType, given[1])
        code = self.sim.CreateDevice(*given)
        self.device.created = self.device.created or not code
        return builder.answer(code)  # type: ignore[no-any-return]

    calls: dict[str, Any] = {
        name: builder.method("WMX3Api", name, overloads, "" if name in WITHOUT_DEVICE else "device")
        for name, overloads in API.items()
    }
    close = calls["CloseDevice"]

    def close_device(self: Any, *arguments: Any) -> int:
        code: int = close(self, *arguments)
        if not code:
            self.device.created, self.device.closed = False, True
        return code

    calls |= {"__init__": init, "CreateDevice": create, "CloseDevice": close_device}
    return type("WMX3Api", (), {**calls, "ErrorToString": builder.text("WMX3Api")})


def _axis_control(made: dict[str, Any]) -> dict[str, Overloads]:
    selection = Of(made["AxisSelection"])
    return {
        "SetServoOn": ((INT, INT),),
        "SetServoOn_AxisSel": ((selection, INT),),
        "ClearAmpAlarm": AXIS,
        "ClearAmpAlarm_AxisSel": ((selection,),),
        "ClearAxisAlarm": AXIS,
        "ClearAxisAlarm_AxisSel": ((selection,),),
        "SetAxisCommandMode": ((INT, INT),),
        "GetAxisCommandMode": AXIS,
        "GetPosCommand": AXIS,
        "GetPosFeedback": AXIS,
        "GetVelCommand": AXIS,
        "GetVelFeedback": AXIS,
    }


def _motion(builder: Builder, owner: str) -> type:
    made = builder.classes.made
    selection = Of(made["AxisSelection"])
    table: dict[str, Overloads] = {
        "Stop": AXIS,
        "Stop_AxisSel": ((selection,),),
        "ExecQuickStop": AXIS,
        "ExecQuickStop_AxisSel": ((selection,),),
        "ExecTimedStop_TimeMilli": ((INT, DOUBLE),),
        "ExecTimedStop_AxisSel": ((selection, DOUBLE),),
    }
    starts = {
        "motion": {
            "StartPos": "Motion_PosCommand",
            "StartMov": "Motion_PosCommand",
            "StartJog": "Motion_JogCommand",
            "StartJog_TimedJog": "Motion_TimedJogCommand",
        },
        "velocity": {"StartVel": "Velocity_VelCommand", "StartVel_TimedVel": "Velocity_TimedVelCommand"},
    }[owner]
    for name, command in starts.items():
        table[name] = ((Of(made[command]),), (INT, ListOf(Of(made[command]))))
    if owner == "motion":
        table["Stop_Dec"] = ((INT, DOUBLE),)
    kind = _table(builder, owner, table, "bus")
    for name in ("Wait", "Wait_AxisSel", "Wait_TimeMilli", "Wait_AxisSel_TimeMilli") if owner == "motion" else ():
        setattr(kind, name, _wait(builder, name))
    return kind


def _wait(builder: Builder, name: str) -> Any:
    def run(self: Any, *arguments: Any) -> int:
        builder.control.faults.append(f"motion.{name} blocks in the vendor's library")
        return int(port.ErrorCode.NoSupportedFunction)

    return run


def _config(builder: Builder) -> type:
    made, extras = builder.classes.made, builder.extras
    kind = _table(builder, "config", CONFIG, "device")
    for block in (*BLOCKS, "EmergencyStopParam"):
        setattr(kind, f"Get{block}", _getter(builder, block, extras))
        setattr(kind, f"Set{block}", _setter(builder, block, made[f"Config_{block}"], extras))
    return kind


def _getter(builder: Builder, block: str, extras: dict[tuple[str, int], dict[str, Any]]) -> Any:
    overloads = NONE if block == "EmergencyStopParam" else AXIS

    def run(self: Any, *arguments: Any) -> Any:
        given = builder.called("config", f"Get{block}", overloads, self, arguments, "device")
        code, value = builder.answer(getattr(self.sim, f"Get{block}")(*given))
        value.values.update(extras.get((block, given[0] if given else 0), {}))
        return code, value

    return run


def _setter(builder: Builder, block: str, kind: type, extras: dict[tuple[str, int], dict[str, Any]]) -> Any:
    overloads: Overloads = ((Of(kind),),) if block == "EmergencyStopParam" else ((INT, Of(kind)),)

    def run(self: Any, *arguments: Any) -> Any:
        given = builder.called("config", f"Set{block}", overloads, self, arguments, "device")
        n_axes = len(self.sim.GetEmergencyStopParam()[1].eStopDec)
        code, _ = getattr(self.sim, f"Set{block}")(*given[:-1], builder.classes.port(given[-1], n_axes))
        if not code:
            names = VENDOR_ONLY.get(f"Config_{block}", {})
            extras[block, given[0] if len(given) > 1 else 0] = {name: given[-1].values[name] for name in names}
        return builder.answer(code), object()

    return run


def _core_motion(builder: Builder, device: type, members: dict[str, type]) -> type:
    numbers = builder.classes.numbers

    def init(self: Any, *arguments: Any) -> None:
        (api,) = take("CoreMotion", ((Of(device),),), arguments)
        self.device = api.device
        self.sim = api.device.library.CoreMotion(api.device.api)
        for name, kind in members.items():
            setattr(self, name, kind(self.device, getattr(self.sim, name)))

    def exec_estop(self: Any, *arguments: Any) -> int:
        (level,) = builder.called("CoreMotion", "ExecEStop", AXIS, self, arguments, "device")
        return builder.answer(self.sim.ExecEStop(numbers.port(port.EStopLevel, level)))  # type: ignore[no-any-return]

    def set_mode(self: Any, *arguments: Any) -> int:
        given = builder.called("axisControl", "SetAxisCommandMode", ((INT, INT),), self, arguments, "device")
        return builder.answer(  # type: ignore[no-any-return]
            self.sim.SetAxisCommandMode(given[0], numbers.port(port.AxisCommandMode, given[1]))
        )

    def get_mode(self: Any, *arguments: Any) -> tuple[int, int]:
        given = builder.called("axisControl", "GetAxisCommandMode", AXIS, self, arguments, "device")
        code, mode = self.sim.GetAxisCommandMode(*given)
        return numbers.code(code), mode if code else numbers.vendor(port.AxisCommandMode, mode)

    members["axisControl"].SetAxisCommandMode = set_mode  # type: ignore[attr-defined]
    members["axisControl"].GetAxisCommandMode = get_mode  # type: ignore[attr-defined]
    for name in ("GetPosCommand", "GetPosFeedback", "GetVelCommand", "GetVelFeedback"):
        setattr(members["axisControl"], name, builder.method("axisControl", name, AXIS, "device"))
    return type(
        "CoreMotion",
        (),
        {
            "__init__": init,
            "GetStatus": builder.method("CoreMotion", "GetStatus", NONE, "device"),
            "ExecEStop": exec_estop,
            "ReleaseEStop": builder.method("CoreMotion", "ReleaseEStop", NONE, "device"),
            "ErrorToString": builder.text("CoreMotion"),
        },
    )


def _io(builder: Builder, device: type) -> type:
    name = builder.variant.io

    def init(self: Any, *arguments: Any) -> None:
        (api,) = take(name, ((Of(device),),), arguments)
        self.device = api.device
        self.sim = api.device.library.Io(api.device.api)

    calls = {call: builder.method("Io", call, overloads, "device") for call, overloads in IO.items()}
    return type(name, (), {"__init__": init, **calls, "ErrorToString": builder.text("Io")})


def _ecat(builder: Builder, device: type) -> type:
    def init(self: Any, *arguments: Any) -> None:
        (api,) = take("Ecat", ((Of(device),),), arguments)
        self.device = api.device
        self.sim = api.device.library.Ecat(api.device.api)

    members: dict[str, Any] = {"__init__": init, "ErrorToString": builder.text("Ecat")}
    for name, kinds in ECAT.items():
        members[name] = _of_a_master(builder, name, kinds)
    return type("Ecat", (), members)


def _of_a_master(builder: Builder, name: str, kinds: tuple[CType, ...]) -> Any:
    """A call that takes the number of a master first where the version wants one."""
    with_master = builder.variant.ecat_takes_master

    def run(self: Any, *arguments: Any) -> Any:
        overloads = ((INT, *kinds),) if with_master else (kinds,)
        given = builder.called("Ecat", name, overloads, self, arguments, "device")
        if with_master and given[0] != 0:
            return builder.answer(port.ErrorCode.ArgumentOutOfRange)
        return builder.answer(getattr(self.sim, name)(*given[int(with_master) :]))

    return run


def _advanced_motion(builder: Builder, device: type) -> type:
    made, variant = builder.classes.made, builder.variant
    times = {"list": ListOf(DOUBLE), "doubleArray": Of(made["doubleArray"]), "uintArray": Of(made["uintArray"])}
    command, point = made["AdvMotion_PointTimeSplineCommand"], made["AdvMotion_SplinePoint"]
    overloads: Overloads = ((UINT, Of(command), UINT, ListOf(Of(point)), times[variant.spline_times]),)

    def start(self: Any, *arguments: Any) -> int:
        given = builder.called("advMotion", variant.spline_call, overloads, self, arguments, "bus")
        channel, which, count, points, given_times = given
        milliseconds = given_times if isinstance(given_times, list) else given_times.items
        builder.control.calls[-1] = (*builder.control.calls[-1][:1], (*builder.control.calls[-1][1][:4], milliseconds))
        if not count <= len(points) or not count <= len(milliseconds):
            builder.control.faults.append(f"{count} points of {len(points)} with {len(milliseconds)} times")
            return builder.classes.numbers.code(port.ErrorCode.ArgumentOutOfRange)
        dimensions = which.values["dimensionCount"]
        rows = [port.AdvMotion_SplinePoint(entry.arrays["pos"][:dimensions]) for entry in points]
        spline = port.AdvMotion_PointTimeSplineCommand(dimensions, which.arrays["axis"][:dimensions])
        code = self.sim.StartCSplinePos_PointTime(channel, spline, count, rows[:count], milliseconds[:count])
        return builder.answer(code)  # type: ignore[no-any-return]

    buffers = _table(builder, "advMotion", SPLINES, "device")
    setattr(buffers, variant.spline_call, start)

    def init(self: Any, *arguments: Any) -> None:
        (api,) = take("AdvancedMotion", ((Of(device),),), arguments)
        self.device = api.device
        self.sim = api.device.library.AdvancedMotion(api.device.api)
        self.advMotion = buffers(self.device, self.sim.advMotion)

    return type("AdvancedMotion", (), {"__init__": init, "ErrorToString": builder.text("AdvancedMotion")})
