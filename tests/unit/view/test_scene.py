"""The model as a viewer receives it."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.docks import load_docks
from robot_stack.core.robot import load_robot
from robot_stack.core.robot_shape import load_robot_shape
from robot_stack.view.scene import Model, joint_angles

ROBOT = load_robot()
MODEL = Model(ROBOT, load_robot_shape(), load_docks())
NOW_NS = 12_000_000_034


def test_wheelchair_and_passenger_are_there_while_they_hang_at_the_latch() -> None:
    parts = {solid.part for solid in MODEL.solids({}, attached=False)}
    assert parts == {"base", "fl_wheel", "fr_wheel", "rl_wheel", "rr_wheel"}
    chair = [solid for solid in MODEL.solids({}, attached=True) if solid.part == "wheelchair"]
    assert chair
    assert min(solid.pose[0, 3] for solid in chair) > ROBOT.footprint.front_m  # in front of the robot


@pytest.mark.parametrize("attached", [False, True])
def test_footprint_is_the_one_in_force(attached: bool) -> None:
    footprint = ROBOT.footprint_with_chair if attached else ROBOT.footprint
    xs, ys = zip(*MODEL.footprint(attached), strict=True)
    assert (min(xs), max(xs)) == (footprint.rear_m, footprint.front_m)
    assert max(ys) - min(ys) == pytest.approx(footprint.width_m)


def test_update_encodes_every_part_once() -> None:
    """Field 3 of an entity is its id: the message contains each part's name once, and the frame it is locked to."""
    wire = MODEL.update({"fl_steer": 0.3}, attached=True, now_ns=NOW_NS).encode()
    for part in (b"base", b"fl_wheel", b"rr_wheel", b"wheelchair", b"footprint"):
        assert wire.count(b"\x1a" + bytes([len(part)]) + part) == 1
    assert wire.count(b"\x12\x09base_link") == 7


def test_update_changes_with_the_joints_alone() -> None:
    still = MODEL.update({}, attached=False, now_ns=NOW_NS).encode()
    assert MODEL.update({}, attached=False, now_ns=NOW_NS).encode() == still
    assert MODEL.update({"rr_drive": 0.1}, attached=False, now_ns=NOW_NS).encode() != still


def test_joint_angles_omits_nan() -> None:
    assert joint_angles(["a", "b", "c"], [1.0, math.nan]) == {"a": 1.0}
