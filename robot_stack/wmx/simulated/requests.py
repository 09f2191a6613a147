"""What a client may ask of the engine, by name: decoding of arguments, dispatch, answers.

Arguments come from another process and are believed nothing: each is checked for type here and for value by the engine.
A wrong number or type of arguments answers ArgumentOutOfRange, an unknown name NoSupportedFunction; neither raises.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.api.enums import AxisCommandMode, DeviceType
from robot_stack.wmx.api.errors import ErrorCode
from robot_stack.wmx.api.parameters import Config_EmergencyStopParam
from robot_stack.wmx.api.values import (
    MAX_AXES,
    Motion_JogCommand,
    Motion_PosCommand,
    Motion_TimedJogCommand,
    Profile,
    Velocity_TimedVelCommand,
    Velocity_VelCommand,
)
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.simulated import checks
from robot_stack.wmx.simulated.devices import Device
from robot_stack.wmx.simulated.engine import Engine
from robot_stack.wmx.simulated.parameter_blocks import BLOCKS, AxisBlock, from_wire, to_wire
from robot_stack.wmx.simulated.parameter_layout import AXIS_ENTRIES, GLOBAL_ENTRIES
from robot_stack.wmx.simulated.protocol import unpack

Answer = tuple[int, list[Any]]
ValueT = TypeVar("ValueT")

_NO_ERROR = int(ErrorCode.PyNone)
_NAME_LENGTH: Final = 64
_LONGEST_WATCHDOG_MS: Final = 3_600_000
_INT_LIMIT: Final = 2**62


class _BadArgument(Exception):
    """An argument is of the wrong type."""


@dataclass(slots=True)
class Session:
    """One client connection; ``device`` is 0 until it has created one, and again after that is closed."""

    device: int = 0


def execute(engine: Engine, session: Session, method: Any, arguments: Sequence[Any]) -> Answer:
    """Carries out one request. Never raises for what a client sent."""
    handler = _HANDLERS.get(method) if isinstance(method, str) else None
    if handler is None:
        return ErrorCode.NoSupportedFunction, []
    if len(arguments) != _ARITY[method]:
        return ErrorCode.ArgumentOutOfRange, []
    device = engine.devices.get(session.device)
    if device is None:
        session.device = 0
        if method not in _WITHOUT_DEVICE:
            return ErrorCode.DeviceIsNull, []
        device = Device(0)
    else:
        engine.devices.touch(device.id, engine.condition.cycles)
    try:
        return handler(_Call(engine, session, device), *arguments)
    except _BadArgument:
        return ErrorCode.ArgumentOutOfRange, []


@dataclass(slots=True)
class _Call:
    engine: Engine
    session: Session
    device: Device


def _int(value: Any) -> int:
    if type(value) is not int or abs(value) > _INT_LIMIT:
        raise _BadArgument
    return value


def _real(value: Any) -> float:
    if type(value) not in (int, float):
        raise _BadArgument
    try:
        return float(value)
    except OverflowError:
        raise _BadArgument from None


def _number(value: Any) -> int | float:
    if type(value) not in (int, float):
        raise _BadArgument
    return value  # type: ignore[no-any-return]


def _list(value: Any, convert: Callable[[Any], ValueT], longest: int) -> list[ValueT]:
    if not isinstance(value, list) or len(value) > longest:
        raise _BadArgument
    return [convert(item) for item in value]


def _axes(value: Any) -> list[int]:
    return _list(value, _int, MAX_AXES)


def _mode(value: Any) -> AxisCommandMode:
    if value not in (0, 1):
        raise _BadArgument
    return AxisCommandMode(value)


def _fields(value: Any, count: int) -> list[Any]:
    if not isinstance(value, list) or len(value) != count:
        raise _BadArgument
    return value


def _profile(value: Any) -> Profile:
    kind, *rest = _fields(value, 8)
    return Profile(_int(kind), *map(_real, rest))


def _position(value: Any) -> Motion_PosCommand:
    axis, target, profile = _fields(value, 3)
    return Motion_PosCommand(_int(axis), _real(target), _profile(profile))


def _jog(value: Any) -> Motion_JogCommand:
    axis, profile = _fields(value, 2)
    return Motion_JogCommand(_int(axis), _profile(profile))


def _timed_jog(value: Any) -> Motion_TimedJogCommand:
    axis, time, profile = _fields(value, 3)
    return Motion_TimedJogCommand(_int(axis), _real(time), _profile(profile))


def _velocity(value: Any) -> Velocity_VelCommand:
    axis, profile = _fields(value, 2)
    return Velocity_VelCommand(_int(axis), _profile(profile))


def _timed_velocity(value: Any) -> Velocity_TimedVelCommand:
    axis, time, profile = _fields(value, 3)
    return Velocity_TimedVelCommand(_int(axis), _real(time), _profile(profile))


def _packed(value: Any) -> NDArray[np.float64]:
    if not isinstance(value, str):
        raise _BadArgument
    try:
        return unpack(value)
    except ValueError:
        raise _BadArgument from None


def _plain(code: int) -> Answer:
    return code, []


# -- device and engine -------------------------------------------------------------------------------------------------


def _create_device(call: _Call, device_type: Any) -> Answer:
    if call.session.device:
        return ErrorCode.ResourceInUse, []
    if _int(device_type) not in list(DeviceType):
        return ErrorCode.ArgumentOutOfRange, []
    code, device = call.engine.create_device(device_type)
    if device is None:
        return code, []
    call.session.device = device.id
    return code, [device.id, call.engine.condition.epoch]


def _close_device(call: _Call) -> Answer:
    call.engine.remove_device(call.session.device)
    call.session.device = 0
    return _NO_ERROR, []


def _set_device_name(call: _Call, name: Any) -> Answer:
    if not isinstance(name, str) or len(name) >= _NAME_LENGTH:
        raise _BadArgument
    call.device.name = name
    return _NO_ERROR, []


def _get_all_devices(call: _Call) -> Answer:
    return _NO_ERROR, [[[d.id, d.type, d.watchdog_ms, d.watchdog_count, d.name] for d in call.engine.devices]]


def _set_watchdog(call: _Call, milliseconds: Any) -> Answer:
    if not 0 <= _int(milliseconds) <= _LONGEST_WATCHDOG_MS:
        return ErrorCode.ArgumentOutOfRange, []
    call.engine.devices.set_watchdog(call.device, milliseconds)
    return _NO_ERROR, []


def _auto_quit(call: _Call, value: Any) -> Answer:
    if not isinstance(value, bool):
        raise _BadArgument
    call.engine.auto_quit = value
    return _NO_ERROR, []


# -- axes --------------------------------------------------------------------------------------------------------------


def _of_axis(call: _Call, axis: Any, values: Callable[[int], list[Any]]) -> Answer:
    code = checks.axes_in_range([_int(axis)], call.engine.arrays.n_axes)
    return (code, []) if code else (_NO_ERROR, values(axis))


def _get_gear(call: _Call, axis: Any) -> Answer:
    return _of_axis(call, axis, lambda index: list(call.engine.parameters.gear[index]))


def _get_polarity(call: _Call, axis: Any) -> Answer:
    return _of_axis(call, axis, lambda index: [call.engine.parameters.polarity[index]])


def _block_kind(name: Any) -> type[AxisBlock]:
    if not isinstance(name, str) or name not in BLOCKS:
        raise _BadArgument
    return BLOCKS[name]


def _get_block(call: _Call, name: Any, axis: Any) -> Answer:
    _block_kind(name)
    return _of_axis(call, axis, lambda index: [to_wire(call.engine.parameters.get(name, index))])


def _set_block(call: _Call, name: Any, axis: Any, data: Any) -> Answer:
    block = from_wire(_block_kind(name), data)
    if block is None:
        raise _BadArgument
    code = checks.axes_in_range([_int(axis)], call.engine.arrays.n_axes)
    return _plain(code or call.engine.parameters.set(name, axis, block))


def _set_estop_block(call: _Call, data: Any) -> Answer:
    block = from_wire(Config_EmergencyStopParam, data)
    if block is None:
        raise _BadArgument
    return _plain(call.engine.parameters.set_emergency_stop(block))


def _get_param(call: _Call) -> Answer:
    parameters = call.engine.parameters
    axes = range(call.engine.arrays.n_axes)
    blocks = {name: [asdict(parameters.get(name, axis)) for axis in axes] for name in BLOCKS}
    return _NO_ERROR, [blocks, asdict(parameters.emergency_stop)]


def _get_axis_param(call: _Call) -> Answer:
    arrays, parameters = call.engine.arrays, call.engine.parameters
    axes = range(arrays.n_axes)
    return _NO_ERROR, [
        arrays.flags[Flag.COMMAND_MODE].tolist(),
        [gear[0] for gear in parameters.gear],
        [gear[1] for gear in parameters.gear],
        list(parameters.polarity),
        [parameters.absolute(axis) for axis in axes],
        arrays.reals[Real.HOME_OFFSET].tolist(),
    ]


def _set_all_parameters(call: _Call, of_engine: Any, of_axes: Any) -> Answer:
    whole = _list(of_engine, _number, len(GLOBAL_ENTRIES))
    axes = _list(of_axes, lambda numbers: _list(numbers, _number, len(AXIS_ENTRIES)), MAX_AXES)
    return _plain(call.engine.parameter_set.apply(whole, axes, call.engine.condition.communicating))


# -- splines -----------------------------------------------------------------------------------------------------------


def _get_spline_buffer(call: _Call, channel: Any) -> Answer:
    code, points = call.engine.motion.splines.points(_int(channel))
    return (code, []) if code else (_NO_ERROR, [points])


def _start_spline(call: _Call, channel: Any, axes: Any, points: Any, times_ms: Any) -> Answer:
    chosen = _axes(axes)
    positions, times = _packed(points), _packed(times_ms)
    if positions.size != len(times) * len(chosen):
        raise _BadArgument
    path = positions.reshape(len(times), len(chosen))
    return _plain(call.engine.motion.start_spline(call.device.id, _int(channel), chosen, path, times))


# -- network -----------------------------------------------------------------------------------------------------------


def _register_read(call: _Call, slave: Any, address: Any, length: Any) -> Answer:
    code, data = call.engine.network.read_registers(_int(slave), _int(address), _int(length))
    return code, [] if code else [data]


_HANDLERS: Final[dict[str, Callable[..., Answer]]] = {
    "CreateDevice": _create_device,
    "CloseDevice": _close_device,
    "StartEngine": lambda c: _plain(c.engine.start_engine()),
    "StopEngine": lambda c: _plain(c.engine.stop_engine()),
    "StartCommunication": lambda c: _plain(c.engine.start_communication()),
    "StopCommunication": lambda c: _plain(c.engine.stop_communication()),
    "SetDeviceName": _set_device_name,
    "GetDeviceName": lambda c: (_NO_ERROR, [c.device.name]),
    "GetAllDevices": _get_all_devices,
    "SetWatchdog": _set_watchdog,
    "GetWatchdog": lambda c: (_NO_ERROR, [c.device.watchdog_ms, c.device.watchdog_count]),
    "ResetWatchdogTimer": lambda c: (_NO_ERROR, []),  # any call does
    "AutoQuitWithoutActiveDev": _auto_quit,
    "ExecEStop": lambda c, level: _plain(c.engine.exec_estop(_int(level))),
    "ReleaseEStop": lambda c: _plain(c.engine.release_estop()),
    "SetServoOn": lambda c, axes, on: _plain(c.engine.set_servo_on(_axes(axes), _int(on))),
    "ClearAmpAlarm": lambda c, axes: _plain(c.engine.clear_amp_alarm(_axes(axes))),
    "ClearAxisAlarm": lambda c, axes: _plain(c.engine.clear_axis_alarm(_axes(axes))),
    "SetAxisCommandMode": lambda c, axis, mode: _plain(c.engine.set_mode(_int(axis), _int(mode))),
    "StartPos": lambda c, commands: _plain(
        c.engine.motion.start_position(c.device.id, _list(commands, _position, MAX_AXES), relative=False)
    ),
    "StartMov": lambda c, commands: _plain(
        c.engine.motion.start_position(c.device.id, _list(commands, _position, MAX_AXES), relative=True)
    ),
    "StartJog": lambda c, commands: _plain(c.engine.motion.start_jog(c.device.id, _list(commands, _jog, MAX_AXES))),
    "StartTimedJog": lambda c, commands: _plain(
        c.engine.motion.start_jog(c.device.id, _list(commands, _timed_jog, MAX_AXES))
    ),
    "StartVel": lambda c, commands: _plain(
        c.engine.motion.start_velocity(c.device.id, _list(commands, _velocity, MAX_AXES))
    ),
    "StartTimedVel": lambda c, commands: _plain(
        c.engine.motion.start_velocity(c.device.id, _list(commands, _timed_velocity, MAX_AXES))
    ),
    "Stop": lambda c, mode, axes: _plain(c.engine.motion.stop(_axes(axes), _mode(mode))),
    "StopDec": lambda c, axis, dec: _plain(c.engine.motion.stop_dec(_int(axis), _real(dec))),
    "QuickStop": lambda c, mode, axes: _plain(c.engine.motion.quick_stop(_axes(axes), _mode(mode))),
    "TimedStop": lambda c, mode, axes, time: _plain(c.engine.motion.timed_stop(_axes(axes), _real(time), _mode(mode))),
    "CreateSplineBuffer": lambda c, channel, points: _plain(
        c.engine.motion.splines.create(_int(channel), _int(points))
    ),
    "FreeSplineBuffer": lambda c, channel: _plain(c.engine.motion.splines.free(_int(channel))),
    "GetSplineBufferPoints": _get_spline_buffer,
    "StartCSplinePosPointTime": _start_spline,
    "StartHome": lambda c, axes: _plain(c.engine.start_home(_axes(axes), c.device.id)),
    "CancelHome": lambda c, axis: _plain(c.engine.cancel_home(_int(axis))),
    "SetCommandPos": lambda c, axis, p: _plain(c.engine.set_position(_int(axis), Real.POS_CMD, _real(p))),
    "SetFeedbackPos": lambda c, axis, p: _plain(c.engine.set_position(_int(axis), Real.ACTUAL_POS, _real(p))),
    "SetHomeDone": lambda c, axis, value: _plain(c.engine.set_home_done(_int(axis), _int(value))),
    "SetGearRatio": lambda c, axis, num, den: _plain(c.engine.set_gear(_int(axis), _real(num), _real(den))),
    "GetGearRatio": _get_gear,
    "SetAxisPolarity": lambda c, axis, sign: _plain(c.engine.set_polarity(_int(axis), _int(sign))),
    "GetAxisPolarity": _get_polarity,
    "GetBlock": _get_block,
    "SetBlock": _set_block,
    "GetEmergencyStopParam": lambda c: (_NO_ERROR, [asdict(c.engine.parameters.emergency_stop)]),
    "SetEmergencyStopParam": _set_estop_block,
    "GetParam": _get_param,
    "GetAxisParam": _get_axis_param,
    "SetAllParameters": _set_all_parameters,
    "GetAllParameters": lambda c: (_NO_ERROR, list(c.engine.parameter_set.collect())),
    "SetOutBit": lambda c, byte, bit, value: _plain(c.engine.set_output_bit(_int(byte), _int(bit), _int(value))),
    "SetOutBytes": lambda c, byte, data: _plain(c.engine.set_outputs(_int(byte), _list(data, _int, 8000))),
    "ScanNetwork": lambda c, master: _plain(c.engine.network.scan(_int(master))),
    "GetMasterInfo": lambda c: (_NO_ERROR, [asdict(c.engine.network.info())]),
    "RegisterRead": _register_read,
    "ResetTransmitStatisticsInfo": lambda c: _plain(c.engine.network.reset_statistics()),
    "StartHotconnect": lambda c: _plain(c.engine.network.start_hotconnect()),
}
_ARITY: Final = {name: handler.__code__.co_argcount - 1 for name, handler in _HANDLERS.items()}
_WITHOUT_DEVICE: Final = frozenset({"CreateDevice", "StartEngine"})

METHODS: Final = tuple(_HANDLERS)
"""Every name a client may use."""
