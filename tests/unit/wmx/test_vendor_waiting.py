"""Is a motion over: by hand-made statuses."""

from __future__ import annotations

import pytest

from robot_stack.wmx.api import ErrorCode, OperationState
from robot_stack.wmx.axes import Flag, StatusSnapshot, empty_snapshot
from robot_stack.wmx.vendor.waiting import motion_result

AT_REST = {Flag.SERVO_ON: 1, Flag.SERVO_OFFLINE: 0, Flag.OP_STATE: OperationState.Idle}
MOVING = AT_REST | {Flag.OP_STATE: OperationState.Pos}


def axes(*columns: dict[Flag, int]) -> StatusSnapshot:
    snapshot = empty_snapshot(len(columns))
    for axis, flags in enumerate(columns):
        for row, value in flags.items():
            snapshot.flags[row, axis] = value
    return snapshot


@pytest.mark.parametrize(
    ("flags", "result"),
    [
        (AT_REST, ErrorCode.PyNone),
        (MOVING, None),
        (MOVING | {Flag.OP_STATE: OperationState.Stop}, None),
        (MOVING | {Flag.OP_STATE: 1 << 30}, None),
        (AT_REST | {Flag.SERVO_OFFLINE: 1}, ErrorCode.ServoOffline),
        (MOVING | {Flag.SERVO_OFFLINE: 1, Flag.AMP_ALARM: 1}, ErrorCode.ServoOffline),
        (MOVING | {Flag.AMP_ALARM: 1, Flag.SERVO_ON: 0}, ErrorCode.AxisAmpAlarm),
        (AT_REST | {Flag.FOLLOWING_ERROR_ALARM: 1}, ErrorCode.AxisAmpAlarm),
        (MOVING | {Flag.SERVO_ON: 0}, ErrorCode.ServoOff),
        (AT_REST | {Flag.POSITIVE_SOFT_LIMIT: 1}, ErrorCode.AxisSoftLimit),
        (AT_REST | {Flag.NEGATIVE_SOFT_LIMIT: 1}, ErrorCode.AxisSoftLimit),
        (AT_REST | {Flag.POSITIVE_LS: 1, Flag.POSITIVE_SOFT_LIMIT: 1}, ErrorCode.AxisHardLimit),
        (AT_REST | {Flag.NEGATIVE_LS: 1}, ErrorCode.AxisHardLimit),
        (MOVING | {Flag.NEGATIVE_LS: 1, Flag.POSITIVE_SOFT_LIMIT: 1}, None),
        (AT_REST | {Flag.POSITIVE_SOFT_LIMIT: 1, Flag.MOTION_COMPLETE: 1}, ErrorCode.PyNone),
    ],
)
def test_one_axis(flags: dict[Flag, int], result: int | None) -> None:
    assert motion_result(axes(flags), [0]) == result
    assert motion_result(axes(AT_REST, flags), [1]) == result
    assert motion_result(axes(flags, AT_REST), [1]) == ErrorCode.PyNone, "another axis is no matter of ours"


def test_several_axes() -> None:
    assert motion_result(axes(MOVING, AT_REST), [0, 1]) is None
    assert motion_result(axes(AT_REST, MOVING), [0, 1]) is None
    assert motion_result(axes(AT_REST, AT_REST), [0, 1]) == ErrorCode.PyNone
    assert motion_result(axes(MOVING, AT_REST | {Flag.SERVO_ON: 0}), [0, 1]) == ErrorCode.ServoOff, "at once"


@pytest.mark.parametrize("axis", [-1, 2, 128])
def test_axis_that_does_not_exist(axis: int) -> None:
    assert motion_result(axes(AT_REST, AT_REST), [0, axis]) == ErrorCode.AxisOutOfRange


def test_without_an_engine() -> None:
    assert motion_result(empty_snapshot(1), [0]) == ErrorCode.ServoOffline
