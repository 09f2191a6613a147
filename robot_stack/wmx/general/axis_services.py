"""The axis services: for each, the requests to the engine, the wait and the response.

Every axis is tried, even if an earlier one failed. A request that is invalid as a whole changes no axis.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from functools import partial
from typing import Final

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import (
    MAX_AXES,
    AxisCommandMode,
    CoreMotionErrorCode,
    ErrorCode,
    OperationState,
)
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.general.answers import Answer, failure, joined
from robot_stack.wmx.general.device import Device
from robot_stack.wmx.general.params import GeneralParams
from robot_stack.wmx.general.requests import Refused, check_finite, check_index, check_lengths
from robot_stack.wmx.general.waiting import Waits
from robot_stack.wmx.general.worker import Job
from robot_stack.wmx.homing import home_is_present_position, homed

_MODES: Final = {0: "Position", 1: "Velocity"}
_OK: Final = int(ErrorCode.PyNone)
# For the end of a motion at velocity zero, in which the axis is already at rest and only its state changes.
_REST_S: Final = 0.5

Steps = Generator[None, None, Answer]


class AxisServices:
    """Jobs of one device. ``stopped`` returns whether an emergency stop forbids motion."""

    def __init__(self, device: Device, waits: Waits, params: GeneralParams, stopped: Callable[[], bool]) -> None:
        self._device, self._waits, self._params, self._stopped = device, waits, params, stopped

    # --- jobs --------------------------------------------------------------------------------------------------------

    def set_on(self, index: Sequence[int], data: Sequence[int]) -> Job:
        """Servos on (1) or off (0); responds when the drives have reported it. All are requested, then all awaited."""
        refusal = _refusal(index, {"data": data})
        if refusal:
            return refusal
        asked = {axis: self._ask_servo(axis, on) for axis, on in zip(index, data, strict=True) if on in (0, 1)}
        wanted = dict(zip(index, data, strict=True))

        def decided(snapshot: StatusSnapshot, axis: int) -> int | None:
            if bool(snapshot.servo_on[axis]) == bool(wanted[axis]):
                return _OK
            return int(ErrorCode.AxisAmpAlarm) if wanted[axis] and snapshot.amp_alarm[axis] else None

        accepted = [axis for axis, code in asked.items() if not code]
        switched = yield from self._waits.until(accepted, decided, self._params.servo_timeout_s)
        codes = asked | switched
        for axis, code in codes.items():
            if code == CoreMotionErrorCode.WaitTimeout and wanted[axis]:
                codes[axis] = int(ErrorCode.ServoOff)
        return joined(self._servo_entry(axis, on, codes) for axis, on in zip(index, data, strict=True))

    def clear_alarm(self, index: Sequence[int]) -> Job:
        """Clears amplifier alarms, and the engine's own following error alarm, which only this call can clear."""
        refusal = _refusal(index, {})
        if refusal:
            return refusal
        asked = {axis: self._ask_clear(axis) for axis in index}

        def decided(snapshot: StatusSnapshot, axis: int) -> int | None:
            return None if snapshot.amp_alarm[axis] or snapshot.following_error_alarm[axis] else _OK

        accepted = [axis for axis, code in asked.items() if not code]
        timeout_s, late = self._params.alarm_timeout_s, int(ErrorCode.AxisAmpAlarm)
        codes = asked | (yield from self._waits.until(accepted, decided, timeout_s, late))
        return joined(
            self._entry(codes[axis], f"Cleared alarm axis {axis}", f"Failed to clear alarm axis {axis}")
            for axis in index
        )

    def set_mode(self, index: Sequence[int], data: Sequence[int]) -> Job:
        """Position (0) or velocity (1) mode."""
        return self._each(index, {"data": data}, lambda place, axis: self._set_mode(axis, data[place]))

    def set_polarity(self, index: Sequence[int], data: Sequence[int]) -> Job:
        """1 or -1."""
        return self._each(index, {"data": data}, lambda place, axis: self._set_polarity(axis, data[place]))

    def set_gear_ratio(self, index: Sequence[int], numerator: Sequence[float], denominator: Sequence[float]) -> Job:
        """Encoder counts per user unit = numerator / denominator."""
        return self._each(
            index,
            {"numerator": numerator, "denominator": denominator},
            lambda place, axis: self._set_gear_ratio(axis, numerator[place], denominator[place]),
        )

    def homing(self, index: Sequence[int]) -> Job:
        """The present position becomes home, one axis after the other."""
        return self._each(index, {}, lambda _, axis: self._home(axis))

    def stop(self, index: Sequence[int]) -> Job:
        """Stops all axes at once, each with its running command's deceleration; answers when they are at rest."""
        refusal = _refusal(index, {})
        if refusal:
            return refusal
        code, snapshot = self._device.read()
        n_axes = snapshot.n_axes if snapshot is not None else 0
        good = [axis for axis in index if 0 <= axis < n_axes]
        codes = self._device.stop(good, snapshot) if snapshot is not None else {}
        accepted = [axis for axis, refused in codes.items() if not refused]
        codes |= yield from self._waits.until(accepted, _at_rest, self._params.stop_timeout_s)
        other = code or int(ErrorCode.AxisOutOfRange)
        return joined(
            self._entry(codes.get(axis, other), f"Stopped axis {axis}", f"Failed to stop axis {axis}") for axis in index
        )

    # --- one axis ----------------------------------------------------------------------------------------------------

    def _ask_servo(self, axis: int, on: int) -> int:
        if on and self._stopped():
            return CoreMotionErrorCode.EmergencyStopSignalOn
        return self._ask(axis, lambda engine: engine.core_motion.axisControl.SetServoOn(axis, on))

    def _servo_entry(self, axis: int, on: int, codes: dict[int, int]) -> Answer:
        if on not in (0, 1):
            return Answer(False, f"Invalid servo value for axis {axis}: {on}")
        word = "on" if on else "off"
        return self._entry(codes[axis], f"Set axis {axis} {word}", f"Failed to set axis {axis} {word}")

    def _ask_clear(self, axis: int) -> int:
        code = self._ask(axis, lambda engine: engine.core_motion.axisControl.ClearAmpAlarm(axis))
        if code:
            return code
        code, snapshot = self._device.read()
        if snapshot is None or not snapshot.following_error_alarm[axis]:
            return code
        return self._ask(axis, lambda engine: engine.core_motion.axisControl.ClearAxisAlarm(axis))

    def _set_mode(self, axis: int, mode: int) -> Steps:
        if mode not in _MODES:
            return Answer(False, f"Invalid mode {mode} for axis {axis}")
        code = yield from self._rest(axis)
        code = code or self._ask(axis, lambda engine: engine.core_motion.axisControl.SetAxisCommandMode(axis, mode))
        if not code:
            shown = yield from self._waits.until([axis], partial(_in_mode, mode), self._params.servo_timeout_s)
            code = shown[axis]
        good = f"Set axis {axis} in {_MODES[mode]} mode"
        return self._entry(code, good, f"Failed to set axis {axis} mode {mode}")

    def _set_polarity(self, axis: int, polarity: int) -> Steps:
        if polarity not in (1, -1):
            return Answer(False, f"Invalid polarity value for axis {axis}: {polarity}")
        code = yield from self._rest(axis)
        code = code or self._ask(axis, lambda engine: engine.core_motion.config.SetAxisPolarity(axis, polarity))
        return self._entry(code, f"Set polarity on axis {axis}", f"Failed to set polarity on axis {axis}")

    def _set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> Steps:
        code = yield from self._rest(axis)
        code = code or self._ask(
            axis, lambda engine: engine.core_motion.config.SetGearRatio(axis, numerator, denominator)
        )
        return self._entry(code, f"Set gear ratio on axis {axis}", f"Failed to set gear ratio on axis {axis}")

    def _home(self, axis: int) -> Steps:
        failed = f"Failed to homing axis {axis}"
        code = yield from self._rest(axis)
        code = code or (int(CoreMotionErrorCode.EmergencyStopSignalOn) if self._stopped() else _OK)
        code = code or self._ask(axis, lambda engine: home_is_present_position(engine, axis))
        code = code or self._ask(axis, lambda engine: engine.core_motion.home.StartHome(axis))
        if code:
            return self._entry(code, "", failed)
        ended = yield from self._waits.until([axis], partial(homed, self._stopped), self._params.homing_timeout_s)
        if ended[axis] in (CoreMotionErrorCode.WaitTimeout, CoreMotionErrorCode.EmergencyStopSignalOn):
            self._ask(axis, lambda engine: engine.core_motion.home.Cancel(axis))
        return self._entry(ended[axis], f"Homing axis {axis}", failed)

    def _rest(self, axis: int) -> Generator[None, None, int]:
        """Ends a motion at velocity zero, by which the documents stop an axis: for the engine it is still in motion.

        Only for motions that this node commanded; the engine refuses others.
        """
        code, snapshot = self._device.read()
        if snapshot is None or not 0 <= axis < snapshot.n_axes:
            return code
        if not snapshot.held_at_zero(axis) or axis not in self._device.moving(snapshot):
            return _OK
        code = self._device.stop([axis], snapshot)[axis]
        if code:
            return code
        return (yield from self._waits.until([axis], _at_rest, _REST_S))[axis]

    # --- details -----------------------------------------------------------------------------------------------------

    def _ask(self, axis: int, request: Callable[[MotionEngine], int]) -> int:
        code, snapshot = self._device.read()
        if code:
            return code
        n_axes = snapshot.n_axes if snapshot is not None else MAX_AXES
        return self._device.call(request) if 0 <= axis < n_axes else int(ErrorCode.AxisOutOfRange)

    def _each(self, index: Sequence[int], fields: dict[str, Sequence[float]], one: Callable[[int, int], Steps]) -> Job:
        refusal = _refusal(index, fields)
        if refusal:
            return refusal
        entries: list[Answer] = []
        for place, axis in enumerate(index):
            entries.append((yield from one(place, axis)))
        return joined(entries)

    def _entry(self, code: int, good: str, bad: str) -> Answer:
        return failure(bad, code, self._device.motion_text) if code else Answer(True, good)


def _refusal(index: Sequence[int], fields: dict[str, Sequence[float]]) -> Answer | None:
    try:
        check_index(index)
        check_lengths(index, fields)
        check_finite(fields)
    except Refused as refused:
        return Answer(False, str(refused))
    return None


def _at_rest(snapshot: StatusSnapshot, axis: int) -> int | None:
    return _OK if snapshot.op_state[axis] == OperationState.Idle else None


def _in_mode(mode: int, snapshot: StatusSnapshot, axis: int) -> int | None:
    return _OK if snapshot.command_mode[axis] == AxisCommandMode(mode) else None
