"""Whether a motion is over, told from a status: waiting without a call that blocks.

The vendor's Wait calls may hold Python's interpreter lock while they block, which would stop every thread of a process.
Nothing calls them: the adapter's own Wait calls poll the status, and a node that must not block asks ``motion_result``
from its timer.
"""

from __future__ import annotations

from collections.abc import Sequence

from robot_stack.wmx.api.enums import OperationState
from robot_stack.wmx.api.errors import ErrorCode
from robot_stack.wmx.axes import Flag, StatusSnapshot


def motion_result(snapshot: StatusSnapshot, axes: Sequence[int]) -> int | None:
    """None while any of ``axes`` still moves without a fault; else the code that a Wait on them ends with.

    PyNone: all are idle. AxisOutOfRange, ServoOffline, AxisAmpAlarm, ServoOff, or AxisHardLimit or AxisSoftLimit for
    an axis that came to rest on a limit, as with the vendor's Wait.
    """
    if any(not 0 <= axis < snapshot.n_axes for axis in axes):
        return ErrorCode.AxisOutOfRange
    idle = True
    for axis in axes:
        code = _fault(snapshot, axis)
        if code:
            return code
        idle = idle and bool(snapshot.flags[Flag.OP_STATE, axis] == OperationState.Idle)
    return ErrorCode.PyNone if idle else None


def _fault(snapshot: StatusSnapshot, axis: int) -> int:
    flags = snapshot.flags
    if flags[Flag.SERVO_OFFLINE, axis]:
        return ErrorCode.ServoOffline
    if flags[Flag.AMP_ALARM, axis] or flags[Flag.FOLLOWING_ERROR_ALARM, axis]:
        return ErrorCode.AxisAmpAlarm
    if not flags[Flag.SERVO_ON, axis]:
        return ErrorCode.ServoOff
    if flags[Flag.OP_STATE, axis] != OperationState.Idle or flags[Flag.MOTION_COMPLETE, axis]:
        return ErrorCode.PyNone
    if flags[Flag.POSITIVE_LS, axis] or flags[Flag.NEGATIVE_LS, axis]:
        return ErrorCode.AxisHardLimit
    on_limit = flags[Flag.POSITIVE_SOFT_LIMIT, axis] or flags[Flag.NEGATIVE_SOFT_LIMIT, axis]
    return ErrorCode.AxisSoftLimit if on_limit else ErrorCode.PyNone
