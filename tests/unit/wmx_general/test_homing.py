"""When a homing is complete, and with which result."""

from __future__ import annotations

import pytest

from robot_stack.wmx.api import CoreMotionErrorCode, ErrorCode, OperationState
from robot_stack.wmx.axes import Flag
from robot_stack.wmx.homing import homed
from tests.unit.wmx_general.snapshots import standing


@pytest.mark.parametrize(
    ("flags", "stopped", "code"),
    [
        ({}, False, None),
        ({Flag.HOME_DONE: 1}, False, ErrorCode.PyNone),
        ({Flag.HOME_DONE: 1, Flag.OP_STATE: OperationState.Home}, False, None),
        ({Flag.HOME_DONE: 1, Flag.AMP_ALARM: 1}, False, ErrorCode.AxisAmpAlarm),
        ({Flag.FOLLOWING_ERROR_ALARM: 1}, False, ErrorCode.AxisAmpAlarm),
        ({Flag.SERVO_ON: 0}, False, ErrorCode.ServoOff),
        ({Flag.OP_STATE: OperationState.Home}, True, CoreMotionErrorCode.EmergencyStopSignalOn),
    ],
)
def test_end_of_a_homing(flags: dict[Flag, int], stopped: bool, code: int | None) -> None:
    snapshot = standing(3)
    for flag, value in flags.items():
        snapshot.flags[flag, 1] = value
    assert homed(lambda: stopped, snapshot, 1) == code
    assert homed(lambda: False, snapshot, 0) is None
    assert homed(lambda: False, standing(emergency_stop=True), 0) == CoreMotionErrorCode.EmergencyStopSignalOn
