"""Joints, fingers and faults in a status."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.wmx.axes import Flag, Real, StatusSnapshot, axis_feedback, empty_snapshot
from robot_stack.wmx.manipulator.joints import JointSettings, faults, read

SETTINGS = JointSettings(("a", "b", "left", "right"), 2, 1, 3, finger_open=0.0, finger_closed=0.045)


def status(outputs: list[int]) -> StatusSnapshot:
    snapshot = empty_snapshot(3)
    snapshot.reals[Real.ACTUAL_POS] = [0.1, -0.2, 9.0]
    snapshot.reals[Real.POS_CMD] = 7.0
    snapshot.reals[Real.ACTUAL_VELOCITY] = [1.0, 2.0, 9.0]
    snapshot.flags[Flag.SERVO_ON] = 1
    object.__setattr__(snapshot, "outputs", np.array(outputs, np.uint8))
    return snapshot


@pytest.mark.parametrize(
    ("outputs", "finger"),
    [([0, 0b1000], 0.045), ([0, 0b11110111], 0.0), ([0b1000, 0], 0.0), ([0b1000], 0.0), ([], 0.0)],
)
def test_read(outputs: list[int], finger: float):
    assert read(axis_feedback(status(outputs)), SETTINGS) == ((0.1, -0.2, finger, finger), (1.0, 2.0, 0.0, 0.0))


@pytest.mark.parametrize("row", [Real.ACTUAL_POS, Real.ACTUAL_VELOCITY])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_non_finite_feedback_is_rejected(row: Real, value: float):
    snapshot = status([0, 0])
    snapshot.reals[row, 1] = value
    assert read(axis_feedback(snapshot), SETTINGS) is None


def test_other_axes_do_not_matter():
    snapshot = status([0, 0])
    snapshot.reals[Real.ACTUAL_POS, 2] = math.nan
    snapshot.flags[Flag.AMP_ALARM, 2] = 1
    snapshot.flags[Flag.SERVO_ON, 2] = 0
    assert read(axis_feedback(snapshot), SETTINGS) is not None
    assert faults(snapshot, SETTINGS, servos=True) == ""


def test_faults():
    snapshot = status([0, 0])
    snapshot.flags[Flag.AMP_ALARM, 0] = 1
    snapshot.flags[Flag.AMP_ALARM_CODE, 0] = 33
    snapshot.flags[Flag.FOLLOWING_ERROR_ALARM, 1] = 1
    snapshot.flags[Flag.SERVO_ON, :2] = 0
    assert faults(snapshot, SETTINGS, servos=True) == "a amplifier alarm 33, b following error, servo off: a b"
    assert faults(snapshot, SETTINGS, servos=False) == "a amplifier alarm 33, b following error"
