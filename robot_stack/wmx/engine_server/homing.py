"""Homing of the simulated engine: the present position becomes home. No drive has a switch to look for."""

from __future__ import annotations

from collections.abc import Sequence

from robot_stack.wmx.api.enums import Config_HomeType, OperationState
from robot_stack.wmx.api.errors import CoreMotionErrorCode, ErrorCode
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.engine_server.parameters import Parameters
from robot_stack.wmx.engine_server.state import EngineArrays

_NO_ERROR = int(ErrorCode.PyNone)


def start(a: EngineArrays, parameters: Parameters, axes: Sequence[int]) -> int:
    """StartHome: all axes or none. The axes exist, the bus runs, and there is no emergency stop."""
    for axis in axes:
        code = _unsupported(Config_HomeType(parameters.home(axis).homeType)) or _startable(a, axis)
        if code:
            return code
    for axis in axes:
        rename(a, axis, Real.POS_CMD, parameters.home(axis).homePosition)
        a.flags[Flag.HOME_DONE, axis] = 1
    return _NO_ERROR


def rename(a: EngineArrays, axis: int, row: Real, position: float) -> None:
    """Shifts the user positions of an axis so that ``row`` reads ``position``; encoder counts stay."""
    reals = a.reals
    shift = position - reals[row, axis]
    reals[Real.HOME_OFFSET, axis] -= shift
    for shifted in (Real.POS_CMD, Real.ACTUAL_POS, Real.PROFILE_TARGET_POS):
        reals[shifted, axis] += shift
    reals[row, axis] = position


def _unsupported(kind: Config_HomeType) -> int:
    if kind is Config_HomeType.CurrentPos:
        return _NO_ERROR
    if "TouchProbe" in kind.name:
        return CoreMotionErrorCode.TouchProbeDetectionUnsupported
    if "LS" in kind.name or "MechanicalEnd" in kind.name:
        return CoreMotionErrorCode.LimitSwitchDetectionUnsupported
    if kind.name.startswith("HS"):
        return CoreMotionErrorCode.HomeSwitchDetectionUnsupported
    return CoreMotionErrorCode.ZPulseDetectionUnsupported if "ZPulse" in kind.name else ErrorCode.NoSupportedFunction


def _startable(a: EngineArrays, axis: int) -> int:
    if not a.flags[Flag.SERVO_ON, axis]:
        return CoreMotionErrorCode.NotServoOn
    return _NO_ERROR if a.flags[Flag.OP_STATE, axis] == OperationState.Idle else ErrorCode.NotIdleState
