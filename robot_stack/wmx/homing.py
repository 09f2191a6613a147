"""Homing as documented: the present position becomes home."""

from __future__ import annotations

from collections.abc import Callable

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import Config_HomeType, CoreMotionErrorCode, ErrorCode, OperationState
from robot_stack.wmx.axes import StatusSnapshot


def home_is_present_position(engine: MotionEngine, axis: int) -> int:
    """Sets the type of homing and leaves its other parameters as they are. The engine's code."""
    config = engine.core_motion.config
    code, param = config.GetHomeParam(axis)
    if code:
        return code
    param.homeType = Config_HomeType.CurrentPos
    return config.SetHomeParam(axis, param)[0]


def homed(stopped: Callable[[], bool], snapshot: StatusSnapshot, axis: int) -> int | None:
    """The result code of a homing, 0 for success; None while it is running."""
    if snapshot.amp_alarm[axis] or snapshot.following_error_alarm[axis]:
        return ErrorCode.AxisAmpAlarm
    if not snapshot.servo_on[axis]:
        return ErrorCode.ServoOff
    if snapshot.emergency_stop or stopped():
        return CoreMotionErrorCode.EmergencyStopSignalOn
    done = snapshot.home_done[axis] and snapshot.op_state[axis] == OperationState.Idle
    return ErrorCode.PyNone if done else None
