"""Joints and fingers in a status."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_stack.core.config import load
from robot_stack.wmx.axes import Real, StatusSnapshot, axis_feedback, empty_snapshot
from robot_stack.wmx.manipulator.joints import read
from robot_stack.wmx.manipulator.params import ManipulatorStateParams

PARAMS = load(ManipulatorStateParams, "manipulator_state").model_copy(
    update={"joint_number": 2, "joint_name": ("a", "b", "left", "right"), "gripper_byte": 1, "gripper_bit": 3}
)


def status(outputs: list[int]) -> StatusSnapshot:
    snapshot = empty_snapshot(3)
    snapshot.reals[Real.ACTUAL_POS] = [0.1, -0.2, 9.0]
    snapshot.reals[Real.POS_CMD] = 7.0
    snapshot.reals[Real.ACTUAL_VELOCITY] = [1.0, 2.0, 9.0]
    object.__setattr__(snapshot, "outputs", np.array(outputs, np.uint8))
    return snapshot


@pytest.mark.parametrize(
    ("outputs", "finger"),
    [([0, 0b1000], 0.045), ([0, 0b11110111], 0.0), ([0b1000, 0], 0.0), ([0b1000], 0.0), ([], 0.0)],
)
def test_read(outputs: list[int], finger: float):
    assert read(axis_feedback(status(outputs)), PARAMS) == ((0.1, -0.2, finger, finger), (1.0, 2.0, 0.0, 0.0))


@pytest.mark.parametrize("row", [Real.ACTUAL_POS, Real.ACTUAL_VELOCITY])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_non_finite_feedback_is_rejected(row: Real, value: float):
    snapshot = status([0, 0])
    snapshot.reals[row, 1] = value
    assert read(axis_feedback(snapshot), PARAMS) is None
