"""Requests of clients to the engine, by name: the calls of the surface, and the server side of the client's own calls.

Arguments come from another process and are untrusted: each is checked for its kind here and for its value by the
engine. A wrong number or type of arguments returns ArgumentOutOfRange, an unknown name NoSupportedFunction; neither
raises.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.api.enums import AxisCommandMode, DeviceType
from robot_stack.wmx.api.errors import ErrorCode
from robot_stack.wmx.api.parameters import Config_AxisParam
from robot_stack.wmx.api.status import DeviceInfo, DevicesInfo
from robot_stack.wmx.api.surface import BLOCKS, SURFACE, Call
from robot_stack.wmx.api.values import MAX_AXES
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.engine_server import checks
from robot_stack.wmx.engine_server.devices import Device
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.parameter_blocks import block_name
from robot_stack.wmx.simulated.parameter_layout import AXIS_ENTRIES, GLOBAL_ENTRIES
from robot_stack.wmx.simulated.protocol import unpack
from robot_stack.wmx.simulated.wire import BadArgument, an_int, decode, encode, items, number, request_name

Answer = tuple[int, list[Any]]

_NO_ERROR = int(ErrorCode.PyNone)
_NAME_LENGTH: Final = 64


@dataclass(slots=True)
class Session:
    """One client connection; ``device`` is 0 until it has created one, and again after that is closed."""

    device: int = 0


@dataclass(slots=True)
class _Asked:
    engine: Engine
    session: Session
    device: Device


def execute(engine: Engine, session: Session, method: Any, arguments: Sequence[Any]) -> Answer:
    """Executes one request. Never raises for a client's data."""
    handler = _HANDLERS.get(method) if isinstance(method, str) else None
    if handler is None:
        return ErrorCode.NoSupportedFunction, []
    if len(arguments) != _ARITY[method]:
        return ErrorCode.ArgumentOutOfRange, []
    device = engine.devices.get(session.device)
    if device is None:
        session.device = 0
        if method != "CreateDevice":
            return ErrorCode.DeviceIsNull, []
        device = Device(0)
    try:
        return handler(_Asked(engine, session, device), *arguments)
    except BadArgument:
        return ErrorCode.ArgumentOutOfRange, []


# -- the surface -------------------------------------------------------------------------------------------------------
# Handlers take arguments of the kinds in the table, and return a code, or a code and the values.


def _set_device_name(asked: _Asked, name: str) -> int:
    if len(name) >= _NAME_LENGTH:
        raise BadArgument
    asked.device.name = name
    return _NO_ERROR


def _get_all_devices(asked: _Asked) -> tuple[int, Any]:
    condition = asked.engine.condition
    devices = [
        DeviceInfo(d.id, d.type, d.watchdog_ms, d.silent_ms(condition.cycles, condition.cycle_time_s), d.name)
        for d in asked.engine.devices
    ]
    return _NO_ERROR, DevicesInfo(len(devices), devices)


def _get_axis_param(asked: _Asked) -> tuple[int, Any]:
    arrays, parameters = asked.engine.arrays, asked.engine.parameters
    return _NO_ERROR, Config_AxisParam(
        arrays.flags[Flag.COMMAND_MODE].tolist(),
        [gear[0] for gear in parameters.gear],
        [gear[1] for gear in parameters.gear],
        list(parameters.polarity),
        [parameters.absolute(axis) for axis in range(arrays.n_axes)],
        arrays.reals[Real.HOME_OFFSET].tolist(),
    )


def _of_axis(asked: _Asked, axis: int, values: Callable[[int], tuple[Any, ...]]) -> Any:
    code = checks.axes_in_range([axis], asked.engine.arrays.n_axes)
    return code or (_NO_ERROR, *values(axis))


def _block_handlers(name: str) -> dict[str, Callable[..., Any]]:
    short = block_name(name)

    def get(asked: _Asked, axis: int) -> Any:
        return _of_axis(asked, axis, lambda one: (asked.engine.parameters.get(short, one),))

    def set_(asked: _Asked, axis: int, block: Any) -> int:
        code = checks.axes_in_range([axis], asked.engine.arrays.n_axes)
        return code or asked.engine.parameters.set(short, axis, block)

    return {f"config.Get{name}": get, f"config.Set{name}": set_}


def _stops(owner: str, mode: AxisCommandMode) -> dict[str, Callable[..., Any]]:
    return {
        f"{owner}.Stop": lambda a, axes: a.engine.motion.stop(axes, mode),
        f"{owner}.ExecQuickStop": lambda a, axes: a.engine.motion.quick_stop(axes, mode),
    }


_OF_SURFACE: Final[dict[str, Callable[..., Any]]] = {
    "WMX3Api.StopCommunication": lambda a, _: a.engine.stop_communication(),
    "WMX3Api.SetDeviceName": _set_device_name,
    "WMX3Api.GetDeviceName": lambda a: (_NO_ERROR, a.device.name),
    "WMX3Api.GetAllDevices": _get_all_devices,
    "CoreMotion.ExecEStop": lambda a, level: a.engine.exec_estop(level),
    "CoreMotion.ReleaseEStop": lambda a: a.engine.release_estop(),
    "axisControl.SetServoOn": lambda a, axes, on: a.engine.set_servo_on(axes, on),
    "axisControl.ClearAmpAlarm": lambda a, axes: a.engine.clear_amp_alarm(axes),
    "axisControl.ClearAxisAlarm": lambda a, axes: a.engine.clear_axis_alarm(axes),
    "axisControl.SetAxisCommandMode": lambda a, axis, mode: a.engine.set_mode(axis, mode),
    "motion.StartPos": lambda a, commands: a.engine.motion.start_position(a.device.id, commands, relative=False),
    "motion.StartMov": lambda a, commands: a.engine.motion.start_position(a.device.id, commands, relative=True),
    **_stops("motion", AxisCommandMode.Position),
    "velocity.StartVel": lambda a, commands: a.engine.motion.start_velocity(a.device.id, commands),
    "velocity.StartVel_TimedVel": lambda a, commands: a.engine.motion.start_velocity(a.device.id, commands),
    **_stops("velocity", AxisCommandMode.Velocity),
    "home.StartHome": lambda a, axes: a.engine.start_home(axes),
    "home.Cancel": lambda a, axis: a.engine.cancel_home(axis),
    "home.SetCommandPos": lambda a, axis, position: a.engine.set_position(axis, Real.POS_CMD, position),
    "config.SetGearRatio": lambda a, axis, num, den: a.engine.set_gear(axis, num, den),
    "config.GetGearRatio": lambda a, axis: _of_axis(a, axis, lambda one: a.engine.parameters.gear[one]),
    "config.SetAxisPolarity": lambda a, axis, sign: a.engine.set_polarity(axis, sign),
    "config.GetAxisPolarity": lambda a, axis: _of_axis(a, axis, lambda one: (a.engine.parameters.polarity[one],)),
    **{request: handler for name in BLOCKS for request, handler in _block_handlers(name).items()},
    "config.GetEmergencyStopParam": lambda a: (_NO_ERROR, a.engine.parameters.emergency_stop),
    "config.SetEmergencyStopParam": lambda a, block: a.engine.parameters.set_emergency_stop(block),
    "config.GetAxisParam": _get_axis_param,
    "advMotion.CreateSplineBuffer": lambda a, channel, points: a.engine.motion.splines.create(channel, points),
    "advMotion.FreeSplineBuffer": lambda a, channel: a.engine.motion.splines.free(channel),
    "advMotion.GetSplineBufferPoints": lambda a, channel: a.engine.motion.splines.points(channel),
    "Io.SetOutBit": lambda a, byte, bit, value: a.engine.set_output_bit(byte, bit, value),
    "Ecat.ScanNetwork": lambda a, master: a.engine.network.scan(master),
}


def _decoded(call: Call, handler: Callable[..., Any]) -> Callable[..., Answer]:
    def run(asked: _Asked, *arguments: Any) -> Answer:
        given = [decode(kind, value) for kind, value in zip(call.takes, arguments, strict=True)]
        result = handler(asked, *given)
        code, *values = result if isinstance(result, tuple) else (result,)
        return code, [] if code else [encode(kind, value) for kind, value in zip(call.values, values, strict=True)]

    return run


# -- behind calls that are the client's own ----------------------------------------------------------------------------


def _create_device(asked: _Asked, device_type: Any) -> Answer:
    if asked.session.device:
        return ErrorCode.ResourceInUse, []
    if an_int(device_type) not in list(DeviceType):
        return ErrorCode.ArgumentOutOfRange, []
    code, device = asked.engine.create_device(device_type)
    if device is None:
        return code, []
    asked.session.device = device.id
    return code, [device.id, asked.engine.condition.epoch]


def _close_device(asked: _Asked) -> Answer:
    asked.engine.remove_device(asked.session.device)
    asked.session.device = 0
    return _NO_ERROR, []


def _set_all_parameters(asked: _Asked, of_engine: Any, of_axes: Any) -> Answer:
    whole = items(of_engine, number, len(GLOBAL_ENTRIES))
    axes = items(of_axes, lambda numbers: items(numbers, number, len(AXIS_ENTRIES)), MAX_AXES)
    return asked.engine.parameter_set.apply(whole, axes, asked.engine.condition.communicating), []


def _start_spline(asked: _Asked, channel: Any, axes: Any, points: Any, times_ms: Any) -> Answer:
    chosen = items(axes, an_int, MAX_AXES)
    positions, times = _packed(points), _packed(times_ms)
    if positions.size != len(times) * len(chosen):
        raise BadArgument
    path = positions.reshape(len(times), len(chosen))
    return asked.engine.motion.start_spline(asked.device.id, an_int(channel), chosen, path, times), []


def _packed(value: Any) -> NDArray[np.float64]:
    if not isinstance(value, str):
        raise BadArgument
    try:
        return unpack(value)
    except ValueError:
        raise BadArgument from None


_OWN: Final[dict[str, Callable[..., Answer]]] = {
    "CreateDevice": _create_device,
    "CloseDevice": _close_device,
    "StopEngine": lambda a: (a.engine.stop_engine(), []),
    "StartCommunication": lambda a: (a.engine.start_communication(), []),
    "SetAllParameters": _set_all_parameters,
    "GetAllParameters": lambda a: (_NO_ERROR, list(a.engine.parameter_set.collect())),
    "StartSpline": _start_spline,
}

_CALLS: Final = {
    request_name(owner, name): call for owner, table in SURFACE.items() for name, call in table.items() if not call.own
}
_HANDLERS: Final = {**_OWN, **{name: _decoded(call, _OF_SURFACE[name]) for name, call in _CALLS.items()}}
_ARITY: Final = {
    **{name: handler.__code__.co_argcount - 1 for name, handler in _OWN.items()},
    **{name: len(call.takes) for name, call in _CALLS.items()},
}

METHODS: Final = tuple(_HANDLERS)
"""Every name that a client may use."""
