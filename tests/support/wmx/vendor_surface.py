"""The classes of the vendor's module with their calls, generated from the interface tables.

``fill(globals(), variant, control)`` makes a module of them; see vendor_fake for their behaviour. Parts that the port
lacks or defines differently are written by hand: the status, the images of inputs and outputs, and version differences.
"""

from __future__ import annotations

from typing import Any, Final

from robot_stack.wmx import api as port
from robot_stack.wmx.api.surface import BLOCKS, ENGINE_BLOCK, SURFACE
from tests.support.wmx.status_records import core_motion_status
from tests.support.wmx.swig import DOUBLE, INT, UINT, ListOf, Of
from tests.support.wmx.swig import taken as take
from tests.support.wmx.vendor_fake import VENDOR_ONLY, Builder, Control, Device, Overloads, Variant

NONE: Final[Overloads] = ((),)


def fill(module: dict[str, Any], variant: Variant, control: Control) -> None:
    """Puts the classes of a variant into a module's namespace."""
    builder = Builder(variant, control)
    made = builder.classes.made
    device = _device(builder)
    members = {name: _table(builder, name) for name in ("axisControl", "motion", "velocity", "home")}
    members["config"] = _config(builder)
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


def _calls(builder: Builder, owner: str) -> dict[str, Any]:
    return {name: builder.method(owner, name, call) for name, call in SURFACE[owner].items()}


def _table(builder: Builder, owner: str, **more: Any) -> type:
    """The class of a member, which calls the simulated engine's object of the same name."""

    def init(self: Any, device: Device, sim: Any) -> None:
        self.device, self.sim = device, sim

    return type(owner, (), {"__init__": init, **_calls(builder, owner), **more})


def _part(builder: Builder, device: type, owner: str, name: str, members: dict[str, Any]) -> type:
    """A class whose constructor takes a device."""

    def init(self: Any, *arguments: Any) -> None:
        (api,) = take(name, ((Of(device),),), arguments)
        self.device = api.device
        self.sim = getattr(api.device.library, owner)(api.device.api)

    return type(name, (), {"__init__": init, "ErrorToString": builder.text(owner), **members})


def _device(builder: Builder) -> type:
    def init(self: Any) -> None:
        self.device = Device(builder.control)
        self.sim = self.device.api

    calls = _calls(builder, "WMX3Api")
    create, close = calls["CreateDevice"], calls["CloseDevice"]

    def create_device(self: Any, *arguments: Any) -> int:
        code: int = create(self, *arguments)
        self.device.created = self.device.created or not code
        return code

    def close_device(self: Any, *arguments: Any) -> int:
        code: int = close(self, *arguments)
        if not code:
            self.device.created, self.device.closed = False, True
        return code

    calls |= {"__init__": init, "CreateDevice": create_device, "CloseDevice": close_device}
    return type("WMX3Api", (), {**calls, "ErrorToString": builder.text("WMX3Api")})


def _config(builder: Builder) -> type:
    """Fields of a block that the port does not have are preserved."""
    kind, extras = _table(builder, "config"), builder.extras
    for block in (*BLOCKS, ENGINE_BLOCK):
        setattr(kind, f"Get{block}", _getter(builder, block, extras))
        setattr(kind, f"Set{block}", _setter(builder, block, extras))
    return kind


def _getter(builder: Builder, block: str, extras: dict[tuple[str, int], dict[str, Any]]) -> Any:
    get = builder.method("config", f"Get{block}", SURFACE["config"][f"Get{block}"])

    def run(self: Any, *arguments: Any) -> Any:
        code, value = get(self, *arguments)
        value.values.update(extras.get((block, arguments[0] if arguments else 0), {}))
        return code, value

    return run


def _setter(builder: Builder, block: str, extras: dict[tuple[str, int], dict[str, Any]]) -> Any:
    call = SURFACE["config"][f"Set{block}"]

    def run(self: Any, *arguments: Any) -> Any:
        given = builder.asked("config", f"Set{block}", call, self, arguments)
        n_axes = len(self.sim.GetEmergencyStopParam()[1].eStopDec)
        code, _ = getattr(self.sim, f"Set{block}")(*given[:-1], builder.classes.port(given[-1], n_axes))
        if not code:
            names = VENDOR_ONLY.get(f"Config_{block}", {})
            extras[block, given[0] if len(given) > 1 else 0] = {name: given[-1].values[name] for name in names}
        return builder.answer(code), object()

    return run


def _core_motion(builder: Builder, device: type, members: dict[str, type]) -> type:
    def init(self: Any, *arguments: Any) -> None:
        (api,) = take("CoreMotion", ((Of(device),),), arguments)
        self.device = api.device
        self.sim = api.device.library.CoreMotion(api.device.api)
        for name, kind in members.items():
            setattr(self, name, kind(self.device, getattr(self.sim, name)))

    def get_status(self: Any, *arguments: Any) -> tuple[int, Any]:
        builder.called("CoreMotion", "GetStatus", NONE, self, arguments, "device")
        code, snapshot = self.device.api.snapshot()
        return builder.classes.numbers.code(int(code)), builder.classes.status(core_motion_status(snapshot))

    calls = {"__init__": init, "GetStatus": get_status, **_calls(builder, "CoreMotion")}
    return type("CoreMotion", (), {**calls, "ErrorToString": builder.text("CoreMotion")})


def _io(builder: Builder, device: type) -> type:
    def reader(name: str, image: str) -> Any:
        def read(self: Any, *arguments: Any) -> tuple[int, list[int]]:
            byte, size = builder.called("Io", name, ((INT, INT),), self, arguments, "device")
            code, snapshot = self.device.api.snapshot()
            values = getattr(snapshot, image)[byte : byte + size].tolist()
            if not code and len(values) < size:
                code = port.ErrorCode.IOSizeOutOfRange
            return builder.classes.numbers.code(int(code)), [] if code else values

        return read

    images = {"GetInBytes": reader("GetInBytes", "inputs"), "GetOutBytes": reader("GetOutBytes", "outputs")}
    return _part(builder, device, "Io", builder.variant.io, {**_calls(builder, "Io"), **images})


def _ecat(builder: Builder, device: type) -> type:
    """In versions that require it, the calls take a master's number first."""
    with_master = builder.variant.ecat_takes_master

    def scan(self: Any, *arguments: Any) -> Any:
        given = builder.called("Ecat", "ScanNetwork", ((INT,) if with_master else (),), self, arguments, "device")
        if with_master and given[0] != 0:
            return builder.answer(port.ErrorCode.ArgumentOutOfRange)
        return builder.answer(self.sim.ScanNetwork())

    return _part(builder, device, "Ecat", "Ecat", {"ScanNetwork": scan})


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

    buffers = _table(builder, "advMotion")
    delattr(buffers, "StartCSplinePos_PointTime")
    setattr(buffers, variant.spline_call, start)
    whole = _part(builder, device, "AdvancedMotion", "AdvancedMotion", {})
    init = whole.__init__  # type: ignore[misc]

    def with_buffers(self: Any, *arguments: Any) -> None:
        init(self, *arguments)
        self.advMotion = buffers(self.device, self.sim.advMotion)

    whole.__init__ = with_buffers  # type: ignore[misc]
    return whole
