"""Axis control, motion, velocity and homing of the simulated engine, as its clients use them."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from robot_stack.wmx.api.enums import AxisCommandMode, OperationState
from robot_stack.wmx.api.errors import CoreMotionErrorCode, ErrorCode
from robot_stack.wmx.api.values import (
    INFINITE,
    AxisSelection,
    Motion_JogCommand,
    Motion_PosCommand,
    Motion_TimedJogCommand,
    Profile,
    Velocity_TimedVelCommand,
    Velocity_VelCommand,
)
from robot_stack.wmx.axes import Flag, Real, StatusSnapshot

if TYPE_CHECKING:
    from robot_stack.wmx.simulated.client import WMX3Api

CommandT = TypeVar("CommandT")


def selected(selection: AxisSelection) -> list[int]:
    """The axes of a selection."""
    return [selection.GetAxis(index) for index in range(selection.axisCount)]


def one_or_many(command: CommandT | int, commands: Sequence[CommandT] | None) -> list[CommandT] | None:
    """The commands of a call that takes one, or a count and a list; None if the list is shorter than the count."""
    if commands is None:
        return None if isinstance(command, int) else [command]
    count = operator.index(command)  # type: ignore[arg-type]
    return list(commands[:count]) if 0 <= count <= len(commands) else None


def _profile(profile: Profile) -> list[Any]:
    return [
        int(profile.type),
        float(profile.velocity),
        float(profile.acc),
        float(profile.dec),
        float(profile.accTimeMilliseconds),
        float(profile.decTimeMilliseconds),
        float(profile.startingVelocity),
        float(profile.endVelocity),
    ]


def _position(command: Motion_PosCommand) -> list[Any]:
    return [operator.index(command.axis), float(command.target), _profile(command.profile)]


def _endless(command: Motion_JogCommand | Velocity_VelCommand) -> list[Any]:
    return [operator.index(command.axis), _profile(command.profile)]


def _timed(command: Motion_TimedJogCommand | Velocity_TimedVelCommand) -> list[Any]:
    return [operator.index(command.axis), float(command.runTimeMilliseconds), _profile(command.profile)]


class AxisControl:
    """Servo, alarms and modes."""

    def __init__(self, api: WMX3Api) -> None:
        self._api = api

    def SetServoOn(self, axis: int, newStatus: int) -> int:
        return self._api.command("SetServoOn", [operator.index(axis)], operator.index(newStatus))

    def SetServoOn_AxisSel(self, axisSelection: AxisSelection, newStatus: int) -> int:
        return self._api.command("SetServoOn", selected(axisSelection), operator.index(newStatus))

    def ClearAmpAlarm(self, axis: int) -> int:
        return self._api.command("ClearAmpAlarm", [operator.index(axis)])

    def ClearAmpAlarm_AxisSel(self, axisSelection: AxisSelection) -> int:
        return self._api.command("ClearAmpAlarm", selected(axisSelection))

    def ClearAxisAlarm(self, axis: int) -> int:
        return self._api.command("ClearAxisAlarm", [operator.index(axis)])

    def ClearAxisAlarm_AxisSel(self, axisSelection: AxisSelection) -> int:
        return self._api.command("ClearAxisAlarm", selected(axisSelection))

    def SetAxisCommandMode(self, axis: int, mode: int) -> int:
        return self._api.command("SetAxisCommandMode", operator.index(axis), operator.index(mode))

    def GetAxisCommandMode(self, axis: int) -> tuple[int, int]:
        code, snapshot = self._of(axis)
        return (code, 0) if code else (code, int(snapshot.flags[Flag.COMMAND_MODE, axis]))

    def GetPosCommand(self, axis: int) -> tuple[int, float]:
        return self._real(axis, Real.POS_CMD)

    def GetPosFeedback(self, axis: int) -> tuple[int, float]:
        return self._real(axis, Real.ACTUAL_POS)

    def GetVelCommand(self, axis: int) -> tuple[int, float]:
        return self._real(axis, Real.VELOCITY_CMD)

    def GetVelFeedback(self, axis: int) -> tuple[int, float]:
        return self._real(axis, Real.ACTUAL_VELOCITY)

    def _of(self, axis: int) -> tuple[int, StatusSnapshot]:
        code, snapshot = self._api.snapshot()
        if not code and not 0 <= axis < snapshot.n_axes:
            code = ErrorCode.AxisOutOfRange
        return code, snapshot

    def _real(self, axis: int, row: Real) -> tuple[int, float]:
        code, snapshot = self._of(axis)
        return (code, 0.0) if code else (code, float(snapshot.reals[row, axis]))


class _Stops:
    """What motion and velocity have in common, each for axes of its own mode."""

    _mode: AxisCommandMode

    def __init__(self, api: WMX3Api) -> None:
        self._api = api

    def Stop(self, axis: int) -> int:
        return self._api.command("Stop", self._mode, [operator.index(axis)])

    def Stop_AxisSel(self, axisSelection: AxisSelection) -> int:
        return self._api.command("Stop", self._mode, selected(axisSelection))

    def ExecQuickStop(self, axis: int) -> int:
        return self._api.command("QuickStop", self._mode, [operator.index(axis)])

    def ExecQuickStop_AxisSel(self, axisSelection: AxisSelection) -> int:
        return self._api.command("QuickStop", self._mode, selected(axisSelection))

    def ExecTimedStop_TimeMilli(self, axis: int, timeMilliseconds: float) -> int:
        return self._api.command("TimedStop", self._mode, [operator.index(axis)], float(timeMilliseconds))

    def ExecTimedStop_AxisSel(self, axisSelection: AxisSelection, timeMilliseconds: float) -> int:
        return self._api.command("TimedStop", self._mode, selected(axisSelection), float(timeMilliseconds))

    def _start(self, method: str, commands: list[list[Any]] | None) -> int:
        return ErrorCode.ArgumentOutOfRange if commands is None else self._api.command(method, commands)


class Motion(_Stops):
    """Motions of axes in position mode."""

    _mode = AxisCommandMode.Position

    def StartPos(self, command: Motion_PosCommand | int, commands: Sequence[Motion_PosCommand] | None = None) -> int:
        batch = one_or_many(command, commands)
        return self._start("StartPos", None if batch is None else [_position(item) for item in batch])

    def StartMov(self, command: Motion_PosCommand | int, commands: Sequence[Motion_PosCommand] | None = None) -> int:
        batch = one_or_many(command, commands)
        return self._start("StartMov", None if batch is None else [_position(item) for item in batch])

    def StartJog(self, command: Motion_JogCommand | int, commands: Sequence[Motion_JogCommand] | None = None) -> int:
        batch = one_or_many(command, commands)
        return self._start("StartJog", None if batch is None else [_endless(item) for item in batch])

    def StartJog_TimedJog(
        self, command: Motion_TimedJogCommand | int, commands: Sequence[Motion_TimedJogCommand] | None = None
    ) -> int:
        batch = one_or_many(command, commands)
        return self._start("StartTimedJog", None if batch is None else [_timed(item) for item in batch])

    def Stop_Dec(self, axis: int, dec: float) -> int:
        return self._api.command("StopDec", operator.index(axis), float(dec))

    def Wait(self, axis: int) -> int:
        return self._wait([axis], INFINITE)

    def Wait_AxisSel(self, axisSelection: AxisSelection) -> int:
        return self._wait(selected(axisSelection), INFINITE)

    def Wait_TimeMilli(self, axis: int, waitTimeMilliseconds: int) -> int:
        return self._wait([axis], waitTimeMilliseconds)

    def Wait_AxisSel_TimeMilli(self, axisSelection: AxisSelection, waitTimeMilliseconds: int) -> int:
        return self._wait(selected(axisSelection), waitTimeMilliseconds)

    def _wait(self, axes: list[int], milliseconds: float) -> int:
        def decided(snapshot: StatusSnapshot) -> int | None:
            if any(not 0 <= axis < snapshot.n_axes for axis in axes):
                return ErrorCode.AxisOutOfRange
            for axis in axes:
                code = _fault(snapshot, axis)
                if code:
                    return code
            at_rest = all(snapshot.flags[Flag.OP_STATE, axis] == OperationState.Idle for axis in axes)
            return ErrorCode.PyNone if at_rest else None

        return self._api.wait_for(decided, milliseconds, CoreMotionErrorCode.WaitTimeout)


class Velocity(_Stops):
    """Motions of axes in velocity mode."""

    _mode = AxisCommandMode.Velocity

    def StartVel(
        self, command: Velocity_VelCommand | int, commands: Sequence[Velocity_VelCommand] | None = None
    ) -> int:
        batch = one_or_many(command, commands)
        return self._start("StartVel", None if batch is None else [_endless(item) for item in batch])

    def StartVel_TimedVel(
        self, command: Velocity_TimedVelCommand | int, commands: Sequence[Velocity_TimedVelCommand] | None = None
    ) -> int:
        batch = one_or_many(command, commands)
        return self._start("StartTimedVel", None if batch is None else [_timed(item) for item in batch])


class Home:
    """Homing and naming of positions."""

    def __init__(self, api: WMX3Api) -> None:
        self._api = api

    def StartHome(self, axis: int) -> int:
        return self._api.command("StartHome", [operator.index(axis)])

    def StartHome_AxisSel(self, axisSelection: AxisSelection) -> int:
        return self._api.command("StartHome", selected(axisSelection))

    def Cancel(self, axis: int) -> int:
        return self._api.command("CancelHome", operator.index(axis))

    def SetCommandPos(self, axis: int, position: float) -> int:
        return self._api.command("SetCommandPos", operator.index(axis), float(position))

    def SetFeedbackPos(self, axis: int, position: float) -> int:
        return self._api.command("SetFeedbackPos", operator.index(axis), float(position))

    def SetHomeDone(self, axis: int, value: int) -> int:
        return self._api.command("SetHomeDone", operator.index(axis), operator.index(value))


def _fault(snapshot: StatusSnapshot, axis: int) -> int:
    """Why a wait on an axis ends before the axis is idle, 0 for no reason."""
    flags = snapshot.flags
    if flags[Flag.SERVO_OFFLINE, axis]:
        return ErrorCode.ServoOffline
    if flags[Flag.AMP_ALARM, axis] or flags[Flag.FOLLOWING_ERROR_ALARM, axis]:
        return ErrorCode.AxisAmpAlarm
    if not flags[Flag.SERVO_ON, axis]:
        return ErrorCode.ServoOff
    at_rest = flags[Flag.OP_STATE, axis] == OperationState.Idle
    return int(flags[Flag.END_REASON, axis]) if at_rest else int(ErrorCode.PyNone)
