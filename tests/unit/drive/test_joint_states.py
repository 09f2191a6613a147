"""Invalid joint state arrays are rejected with the field and its limit."""

from __future__ import annotations

import math

import pytest

from robot_stack.contract.frames import JOINTS
from robot_stack.drive.joint_states import BadJointStates, encoders

POSITIONS = [10.0, 0.1, 20.0, 0.2, 30.0, 0.3, 40.0, 0.4]


def test_joints_are_sorted_by_name():
    got = encoders(1.5, JOINTS, POSITIONS, 7.0)
    assert got.received_s == 7.0
    assert (got.stamp_s, got.drive_rad, got.steer_rad) == (1.5, (10.0, 20.0, 30.0, 40.0), (0.1, 0.2, 0.3, 0.4))
    assert encoders(1.5, list(reversed(JOINTS)), list(reversed(POSITIONS))) == got


@pytest.mark.parametrize(
    ("names", "positions", "says"),
    [
        ((), POSITIONS, "name must be the 8 joints"),
        (JOINTS[:7], POSITIONS[:7], "name must be the 8 joints"),
        ((*JOINTS[:7], "fl_drive"), POSITIONS, "name must be the 8 joints"),
        ((*JOINTS[:7], "joint8"), POSITIONS, "name must be the 8 joints"),
        (JOINTS, POSITIONS[:7], "position must have 8 values, has 7"),
        (JOINTS, [*POSITIONS, 0.0], "position must have 8 values, has 9"),
        (JOINTS, [*POSITIONS[:7], math.nan], "position of rr_steer must be finite, is nan"),
        (JOINTS, [math.inf, *POSITIONS[1:]], "position of fl_drive must be finite, is inf"),
    ],
)
def test_refusals(names: tuple[str, ...], positions: list[float], says: str):
    with pytest.raises(BadJointStates, match=says):
        encoders(0.0, names, positions)
